// Names that tell left from right, as skeletons have them.
#pragma once

#include <cctype>
#include <string>
#include <string_view>
#include <vector>

namespace quadrig {

/// What the name of a bone may be on the other side: "arm.L", "arm_l", "LeftArm", "mixamorig:LeftArm", "L_Arm", "arm
/// L". Empty where nothing in it tells a side. \cost O(length²)
[[nodiscard]] inline std::vector<std::string> mirrored_names(std::string_view name) {
  std::vector<std::string> found;
  const auto is_letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
  const auto lower = [](char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); };
  const auto upper = [](char c) { return static_cast<char>(std::toupper(static_cast<unsigned char>(c))); };
  const auto replaced = [&](std::size_t place, std::size_t length, std::string_view by) {
    std::string other(name.substr(0, place));
    for (std::size_t i = 0; i < by.size(); ++i) {
      const char like = name[place + std::min(i, length - 1)];
      other += std::isupper(static_cast<unsigned char>(like)) ? upper(by[i]) : by[i];
    }
    found.push_back(other + std::string(name.substr(place + length)));
  };
  const auto word_at = [&](std::size_t place, std::string_view word) {
    if (place + word.size() > name.size()) return false;
    for (std::size_t i = 0; i < word.size(); ++i)
      if (lower(name[place + i]) != word[i]) return false;
    return true;
  };
  for (std::size_t k = 0; k < name.size(); ++k) {
    if (word_at(k, "left")) replaced(k, 4, "right");
    if (word_at(k, "right")) replaced(k, 5, "left");
    const char c = lower(name[k]);
    if (c != 'l' && c != 'r') continue;
    // A letter by itself: after and before what is no letter, or the small beginning of a word in capitals ("lArm").
    const bool begins = k == 0 || !is_letter(name[k - 1]);
    const bool ends = k + 1 == name.size() || !is_letter(name[k + 1]);
    const bool prefix = begins && !ends && std::isupper(static_cast<unsigned char>(name[k + 1])) &&
                        k + 2 < name.size() && std::islower(static_cast<unsigned char>(name[k + 2]));
    if (begins && (ends || prefix)) replaced(k, 1, c == 'l' ? "r" : "l");
  }
  return found;
}

}  // namespace quadrig
