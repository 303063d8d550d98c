// The shim of shim.h. C++ calls nothing of the caller's; nothing is thrown past it. Version branches live here alone.

#include "shim.h"

// Conversions of half in the header itself, so that Imath need not be linked.
#define IMATH_HALF_NO_LOOKUP_TABLE

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/half.h>
#include <OpenImageIO/imageio.h>

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <vector>

#if OIIO_VERSION < OIIO_MAKE_VERSION(2, 4, 0) || OIIO_VERSION >= OIIO_MAKE_VERSION(3, 0, 0)
#error "OpenImageIO 2.4 or 2.5 is expected"
#endif

static_assert(sizeof(pathspace_oiio_info) == 244, "as in src/lib.rs");

namespace {

using OIIO::ImageInput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

constexpr int OK = 0, FAILED = 1;

enum Kind : uint32_t { EIGHT = 0, SIXTEEN = 1, HALF = 2, FLOAT = 3 };

void copy(char* to, size_t size, const std::string& from) noexcept {
  if (!to || size == 0) return;
  const size_t length = std::min(from.size(), size - 1);
  std::memcpy(to, from.data(), length);
  to[length] = 0;
}

struct Failure : std::exception {
  std::string message;
  explicit Failure(std::string m) : message(m.empty() ? "no reason given" : std::move(m)) {}
  const char* what() const noexcept override { return message.c_str(); }
};

// Runs `f` and turns whatever it throws into a code and a message.
template<class F> int guarded(char* error, size_t error_size, F&& f) noexcept {
  try {
    f();
    return OK;
  } catch (const std::bad_alloc&) {
    copy(error, error_size, "out of memory");
  } catch (const std::exception& e) {
    try {
      copy(error, error_size, e.what());
    } catch (...) {
    }
  } catch (...) {
    copy(error, error_size, "an exception of an unknown type");
  }
  return FAILED;
}

// Images are decoded side by side by the caller's threads, so the library starts none of its own.
void initialise() {
  static std::once_flag once;
  std::call_once(once, [] {
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1);
  });
}

Kind kind_of(TypeDesc type) {
  switch (type.basetype) {
    case TypeDesc::UINT8: return EIGHT;
    case TypeDesc::UINT16: return SIXTEEN;
    case TypeDesc::HALF: return ::HALF;
    default: return FLOAT;
  }
}

TypeDesc type_of(Kind kind) {
  switch (kind) {
    case EIGHT: return TypeDesc::UINT8;
    case SIXTEEN: return TypeDesc::UINT16;
    case ::HALF: return TypeDesc::HALF;
    default: return TypeDesc::FLOAT;
  }
}

size_t size_of(Kind kind) { return kind == EIGHT ? 1 : kind == FLOAT ? 4 : 2; }

template<class T> float value(T v) { return static_cast<float>(v); }
template<> float value(uint16_t v) { return static_cast<float>(v) / 65535.0f; }

// One texel to four channels. Every path to a texel ends here, so that all give the same bits.
template<class To, class From> inline void expand(const From* from, int channels, To* to, To one) {
  const auto at = [&](int c) -> To {
    if constexpr (std::is_same_v<To, uint8_t>) return from[c];
    else return value(from[c]);
  };
  to[0] = at(0);
  to[1] = channels >= 3 ? at(1) : to[0];
  to[2] = channels >= 3 ? at(2) : to[0];
  to[3] = channels >= 4 ? at(3) : channels == 2 ? at(1) : one;
}

void expand(Kind kind, const void* from, int channels, void* to) {
  switch (kind) {
    case EIGHT: return expand(static_cast<const uint8_t*>(from), channels, static_cast<uint8_t*>(to), uint8_t(255));
    case SIXTEEN: return expand(static_cast<const uint16_t*>(from), channels, static_cast<float*>(to), 1.0f);
    case ::HALF: return expand(static_cast<const half*>(from), channels, static_cast<float*>(to), 1.0f);
    default: return expand(static_cast<const float*>(from), channels, static_cast<float*>(to), 1.0f);
  }
}

size_t texel_size(Kind kind) { return kind == EIGHT ? 4 : 16; }

bool is_alike(const ImageSpec& a, const ImageSpec& b) {
  return a.format == b.format && a.nchannels == b.nchannels && a.tile_width == b.tile_width &&
         a.tile_height == b.tile_height;
}

void check(const ImageSpec& spec) {
  if (spec.deep || spec.depth > 1) throw Failure("deep and volume images are not textures");
  if (spec.nchannels < 1) throw Failure("an image without channels");
  if (!spec.channelformats.empty()) {
    for (const TypeDesc& format : spec.channelformats) {
      if (format != spec.channelformats[0]) throw Failure("channels of different types");
    }
  }
  if (spec.channelindex("RY") >= 0 || spec.channelindex("BY") >= 0) {
    throw Failure("channels of luminance and chroma; R, G and B are expected");
  }
}

// Whether a reader has this name or reads files whose names end so. The library would take any other word for a file to
// be opened by each of its readers; the readers of movies and terminals open more than images.
bool is_format(const std::string& name) {
  std::string list = OIIO::get_string_attribute("extension_list");
  for (size_t begin = 0; begin < list.size();) {
    const size_t end = std::min(list.find(';', begin), list.size());
    const std::string entry = list.substr(begin, end - begin);
    begin = end + 1;
    const size_t colon = std::min(entry.find(':'), entry.size());
    const std::string reader = entry.substr(0, colon);
    if (reader == "ffmpeg" || reader == "null" || reader == "term") continue;
    const std::string ends = colon < entry.size() ? "," + entry.substr(colon + 1) + "," : "";
    if (reader == name || ends.find("," + name + ",") != std::string::npos) return true;
  }
  return false;
}

pathspace_oiio_info describe(const ImageInput& input, const ImageSpec& spec) {
  pathspace_oiio_info info = {};
  info.channels = uint32_t(spec.nchannels);
  info.kind = kind_of(spec.format);
  info.tile_width = uint32_t(spec.tile_width);
  info.tile_height = uint32_t(spec.tile_height);
  info.levels = 1;
  info.width[0] = uint32_t(std::max(spec.width, 0));
  info.height[0] = uint32_t(std::max(spec.height, 0));
  copy(info.format, sizeof info.format, input.format_name());
  return info;
}

}  // namespace

struct pathspace_oiio_reader {
  std::unique_ptr<OIIO::Filesystem::IOMemReader> bytes;  // outlives `input`
  std::unique_ptr<ImageInput> input;
  pathspace_oiio_info info;
  std::vector<unsigned char> row;
};

void pathspace_oiio_version(char* version, size_t version_size, char* file, size_t file_size) noexcept {
  guarded(nullptr, 0, [&] {
    const int number = OIIO::openimageio_version();
    copy(version, version_size,
         std::to_string(number / 10000) + "." + std::to_string(number / 100 % 100) + "." +
         std::to_string(number % 100));
    Dl_info found = {};
    const bool known = dladdr(reinterpret_cast<void*>(&OIIO::openimageio_version), &found) != 0 && found.dli_fname;
    copy(file, file_size, known ? found.dli_fname : "");
  });
}

int pathspace_oiio_open(const char* name, const char* format, const void* bytes, size_t size,
                        pathspace_oiio_reader** reader, pathspace_oiio_info* info, char* error,
                        size_t error_size) noexcept {
  return guarded(error, error_size, [&] {
    initialise();
    auto opened = std::make_unique<pathspace_oiio_reader>();
    ImageSpec config;
    // Base colours are not premultiplied in glTF.
    config.attribute("oiio:UnassociatedAlpha", 1);
    if (!is_format(format)) throw Failure("no reader for this format");
    opened->input = ImageInput::create(format);
    if (!opened->input) throw Failure(OIIO::geterror());
    if (bytes) {
      opened->bytes = std::make_unique<OIIO::Filesystem::IOMemReader>(bytes, size);
      if (!opened->input->supports("ioproxy") || !opened->input->set_ioproxy(opened->bytes.get())) {
        throw Failure("this format is read from files only");
      }
    }
    ImageSpec first;
    if (!opened->input->open(name, first, config)) throw Failure(opened->input->geterror());
    check(first);
    opened->info = describe(*opened->input, first);
    // Levels of a pyramid, as far as each is half its predecessor, rounded either way.
    pathspace_oiio_info& i = opened->info;
    while (i.tile_width != 0 && i.levels < PATHSPACE_OIIO_LEVELS) {
      if (!opened->input->seek_subimage(0, int(i.levels))) break;
      const ImageSpec spec = opened->input->spec();
      const auto halved = [](uint32_t of, int is) {
        return is >= 1 && (uint32_t(is) == std::max(of / 2, 1u) || uint32_t(is) == (of + 1) / 2);
      };
      const uint32_t before = i.levels - 1;
      if (!is_alike(first, spec)) break;
      if (!halved(i.width[before], spec.width) || !halved(i.height[before], spec.height)) break;
      if (i.width[before] == 1 && i.height[before] == 1) break;
      i.width[i.levels] = uint32_t(spec.width);
      i.height[i.levels] = uint32_t(spec.height);
      i.levels++;
    }
    (void)opened->input->geterror();
    *info = i;
    *reader = opened.release();
  });
}

int pathspace_oiio_read(pathspace_oiio_reader* reader, uint32_t level, const uint32_t* area, void* texels, char* error,
                        size_t error_size) noexcept {
  return guarded(error, error_size, [&] {
    const pathspace_oiio_info& info = reader->info;
    const auto [left, right, top, bottom] = std::array<uint32_t, 4>{area[0], area[1], area[2], area[3]};
    if (level >= info.levels || left > right || right > info.width[level] || top > bottom ||
        bottom > info.height[level])
      throw Failure("texels outside of the image");
    ImageInput& input = *reader->input;
    const ImageSpec spec = input.spec(0, int(level));
    if (spec.width != int(info.width[level]) || spec.height != int(info.height[level]) ||
        spec.nchannels != int(info.channels) || kind_of(spec.format) != Kind(info.kind) ||
        spec.tile_width != int(info.tile_width) || spec.tile_height != int(info.tile_height))
      throw Failure("the image changed");
    if (spec.tile_width == 0 && (left != 0 || right != info.width[level])) throw Failure("columns of scan lines");
    const int channels = std::min(spec.nchannels, 4);
    const Kind kind = Kind(info.kind);
    const size_t from_size = size_of(kind) * size_t(channels), count = size_t(right - left) * size_t(bottom - top);
    reader->row.resize(from_size * count);
    const int x0 = spec.x + int(left), x1 = spec.x + int(right), y0 = spec.y + int(top), y1 = spec.y + int(bottom);
    const bool read =
        spec.tile_width != 0
            ? input.read_tiles(0, int(level), x0, x1, y0, y1, spec.z, spec.z + 1, 0, channels, type_of(kind),
                               reader->row.data())
            : input.read_scanlines(0, int(level), y0, y1, spec.z, 0, channels, type_of(kind), reader->row.data());
    // A decoder may fill up what is missing and say so.
    const bool complained = input.has_error();
    const std::string problem = input.geterror();
    if (!read || complained) throw Failure(problem);
    auto* to = static_cast<unsigned char*>(texels);
    const unsigned char* from = reader->row.data();
    for (size_t i = 0; i < count; i++) expand(kind, from + i * from_size, channels, to + i * texel_size(kind));
  });
}

void pathspace_oiio_close(pathspace_oiio_reader* reader) noexcept {
  guarded(nullptr, 0, [&] { delete reader; });
}
