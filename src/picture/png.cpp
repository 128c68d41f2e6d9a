#include <png.h>

#include <cstdio>

#include "picture/picture.hpp"

namespace quadrig {

Status write_png(const Image& image, const std::filesystem::path& file) {
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  header.width = static_cast<png_uint_32>(image.width);
  header.height = static_cast<png_uint_32>(image.height);
  header.format = PNG_FORMAT_RGB;
  if (!png_image_write_to_file(&header, file.string().c_str(), 0, image.rgb.data(), 0, nullptr))
    return Error{ErrorCode::bad_file, header.message, file.string(), "is the folder there and writable?"};
  return {};
}

}  // namespace quadrig
