// Data URIs, and names of files that stay in the document's folder.
#include <algorithm>
#include <array>

#include "document.hpp"

namespace quadrig::gltf {
namespace {

constexpr std::ptrdiff_t most_folders = 64;  // in a name; each is looked up

constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

int hexadecimal(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

}  // namespace

std::string percent_decoded(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size()) {
      const int high = hexadecimal(text[i + 1]), low = hexadecimal(text[i + 2]);
      if (high >= 0 && low >= 0) {
        result += static_cast<char>(16 * high + low);
        i += 2;
        continue;
      }
    }
    result += text[i];
  }
  return result;
}

std::string percent_encoded(std::string_view name) {
  constexpr std::string_view digits16 = "0123456789ABCDEF";
  std::string uri;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if ((c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' || c == '_' || c == '-')
      uri += c;
    else
      uri.append(1, '%').append(1, digits16[byte >> 4U]).append(1, digits16[byte & 15U]);
  }
  return uri;
}

std::string encode_base64(std::string_view bytes) {
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k)
      three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : digits[three >> (18 - 6 * k) & 63U];
  }
  return text;
}

Expected<std::string> decode_data_uri(const State& state, std::string_view uri, const std::string& where) {
  const auto comma = uri.find(',');
  if (comma == std::string_view::npos) return state.bad(where, "is a data URI without data");
  const std::string_view data = uri.substr(comma + 1);
  if (!uri.substr(0, comma).ends_with(";base64")) return percent_decoded(data);
  std::array<signed char, 256> value{};
  value.fill(-1);
  for (std::size_t i = 0; i < digits.size(); ++i)
    value[static_cast<unsigned char>(digits[i])] = static_cast<signed char>(i);
  value[static_cast<unsigned char>('-')] = 62;  // the alphabet of URLs, which some writers use
  value[static_cast<unsigned char>('_')] = 63;
  std::string bytes;
  bytes.reserve(data.size() / 4 * 3 + 3);
  std::uint32_t bits = 0;
  int held = 0;
  for (std::size_t i = 0; i < data.size() && data[i] != '='; ++i) {
    const int digit = value[static_cast<unsigned char>(data[i])];
    if (digit < 0)
      return state.bad(where, "has a character at " + std::to_string(i) + " of its data that is not base64");
    bits = (bits << 6 | static_cast<std::uint32_t>(digit)) & 0xffffffU;
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes += static_cast<char>(bits >> held & 0xffU);
    }
  }
  return bytes;
}

Expected<std::filesystem::path> relative_file(const State& state, std::string_view uri, const std::string& where) {
  const std::string remedy = "keep the files of an asset in one folder and name them relative to it";
  const auto unusable = [&](const char* what) {
    return Error{ErrorCode::bad_file, what, state.name.string() + ": " + where, "rename it, and export the file again"};
  };
  if (has_scheme(uri)) return state.bad(where, "names something elsewhere", remedy);
  const std::filesystem::path named = percent_decoded(uri);
  if (std::count(named.native().begin(), named.native().end(), '/') > most_folders)
    return state.bad(where, "is within too many folders", remedy);
  if (named.empty() || named.is_absolute() || named.native().find('\0') != std::string::npos)
    return state.bad(where, "is not a relative name", remedy);
  for (const auto& part : named) {
    if (part == "..") return state.bad(where, "leaves the folder of the file", remedy);
    if (part.native().starts_with('.') && part != ".") return unusable("names a hidden file");
  }
  const std::filesystem::path folder = state.name.parent_path();
  if (folder.empty() && !std::filesystem::exists(state.name))
    return state.bad(where, "names a file, and the document is not one itself", remedy);
  // Links are followed before the folders are compared, so that none leads out.
  std::error_code error;
  const auto home = std::filesystem::weakly_canonical(folder.empty() ? "." : folder, error);
  const auto there = std::filesystem::weakly_canonical((folder.empty() ? "." : folder) / named, error);
  const auto inside = there.lexically_relative(home);
  if (error || inside.empty() || *inside.begin() == "..")
    return state.bad(where, "leaves the folder of the file", remedy);
  // A pipe or a device would be waited for, or never end.
  const std::filesystem::file_status status = std::filesystem::status(there, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    return unusable("is no regular file");
  return there;
}

bool is_image(std::string_view bytes) {
  using namespace std::string_view_literals;
  // PNG, JPEG, WebP, KTX 1 and 2, DDS, AVIF, GIF, BMP, Radiance, OpenEXR.
  constexpr std::string_view beginnings[] = {"\x89PNG\r\n\x1a\n"sv,
                                             "\xff\xd8\xff"sv,
                                             "\xabKTX 11\xbb\r\n\x1a\n"sv,
                                             "\xabKTX 20\xbb\r\n\x1a\n"sv,
                                             "DDS "sv,
                                             "GIF8"sv,
                                             "BM"sv,
                                             "#?RADIANCE"sv,
                                             "\x76\x2f\x31\x01"sv};
  for (const std::string_view beginning : beginnings)
    if (bytes.starts_with(beginning)) return true;
  if (bytes.size() < 12) return false;
  return (bytes.starts_with("RIFF") && bytes.substr(8, 4) == "WEBP") || bytes.substr(4, 8) == "ftypavif";
}

namespace {

void collect_uris(const Json& json, std::set<std::string>& uris) {
  if (json.is_object())
    if (const Json* uri = member(json, "uri"); uri && uri->is_string()) uris.insert(uri->get_ref<const std::string&>());
  if (json.is_structured())
    for (const Json& part : json) collect_uris(part, uris);
}

}  // namespace
}  // namespace quadrig::gltf

namespace quadrig {

std::vector<std::filesystem::path> GltfDocument::named_files() const {
  constexpr std::size_t longest_name = 4096;  // of Linux; nothing is called by a longer one
  const auto deep = [](std::string_view name) {
    return std::count(name.begin(), name.end(), '/') > gltf::most_folders;
  };
  std::set<std::string> uris;
  gltf::collect_uris(state_->json, uris);
  std::vector<std::filesystem::path> files;
  for (const std::string& uri : uris) {
    std::string_view name = uri;
    if (name.starts_with("file://")) name.remove_prefix(7);
    if (name.empty() || name.size() > 3 * longest_name || gltf::has_scheme(name)) continue;
    const std::string decoded = gltf::percent_decoded(name);
    if (decoded.find('\0') == std::string::npos && decoded.size() <= longest_name && !deep(decoded))
      files.push_back(state_->name.parent_path() / decoded);
  }
  return files;
}

}  // namespace quadrig
