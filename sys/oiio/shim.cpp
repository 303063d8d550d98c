// The shim of shim.h. C++ calls nothing of the caller's; nothing is thrown past it. Version branches live here alone.

#include "shim.h"

// Conversions of half in the header itself, so that Imath need not be linked.
#define IMATH_HALF_NO_LOOKUP_TABLE

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/half.h>
#include <OpenImageIO/imagecache.h>
#include <OpenImageIO/imageio.h>

#include <dlfcn.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <array>
#include <atomic>
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
static_assert(sizeof(pathspace_oiio_texel) == 12, "as in src/lib.rs");
static_assert(sizeof(pathspace_oiio_stats) == 48, "as in src/lib.rs");

namespace {

using OIIO::ImageCache;
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
  return a.format == b.format && a.nchannels == b.nchannels && (a.tile_width != 0) == (b.tile_width != 0);
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
         std::to_string(number / 10000) + "." + std::to_string(number / 100 % 100) + "." + std::to_string(number % 100));
    Dl_info found = {};
    const bool known = dladdr(reinterpret_cast<void*>(&OIIO::openimageio_version), &found) != 0 && found.dli_fname;
    copy(file, file_size, known ? found.dli_fname : "");
  });
}

int pathspace_oiio_open(const char* name, const char* format, const void* bytes, size_t size, pathspace_oiio_reader** reader,
                        pathspace_oiio_info* info, char* error, size_t error_size) noexcept {
  return guarded(error, error_size, [&] {
    initialise();
    auto opened = std::make_unique<pathspace_oiio_reader>();
    ImageSpec config;
    // Base colours are not premultiplied in glTF.
    config.attribute("oiio:UnassociatedAlpha", 1);
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
      if (!is_alike(first, spec) || !halved(i.width[before], spec.width) || !halved(i.height[before], spec.height)) break;
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

int pathspace_oiio_read(pathspace_oiio_reader* reader, uint32_t level, uint32_t begin, uint32_t end, void* texels, char* error,
                        size_t error_size) noexcept {
  return guarded(error, error_size, [&] {
    const pathspace_oiio_info& info = reader->info;
    if (level >= info.levels || begin > end || end > info.height[level]) throw Failure("rows outside of the image");
    ImageInput& input = *reader->input;
    const ImageSpec spec = input.spec(0, int(level));
    if (spec.width != int(info.width[level]) || spec.height != int(info.height[level])) throw Failure("the image changed");
    const int channels = std::min(spec.nchannels, 4);
    const Kind kind = Kind(info.kind);
    const size_t from_size = size_of(kind) * size_t(channels), width = size_t(spec.width);
    reader->row.resize(from_size * width * (end - begin));
    const int y0 = spec.y + int(begin), y1 = spec.y + int(end);
    const bool read =
        spec.tile_width != 0
            ? input.read_tiles(0, int(level), spec.x, spec.x + spec.width, y0, y1, spec.z, spec.z + 1, 0, channels,
                               type_of(kind), reader->row.data())
            : input.read_scanlines(0, int(level), y0, y1, spec.z, 0, channels, type_of(kind), reader->row.data());
    // A decoder may fill up what is missing and say so.
    const bool complained = input.has_error();
    const std::string problem = input.geterror();
    if (!read || complained) throw Failure(problem);
    auto* to = static_cast<unsigned char*>(texels);
    const unsigned char* from = reader->row.data();
    for (size_t i = 0, n = width * (end - begin); i < n; i++) {
      expand(kind, from + i * from_size, channels, to + i * texel_size(kind));
    }
  });
}

void pathspace_oiio_close(pathspace_oiio_reader* reader) noexcept {
  guarded(nullptr, 0, [&] { delete reader; });
}

int pathspace_oiio_write(const char* path, const pathspace_oiio_info* info, const void* const* levels, char* error,
                         size_t error_size) noexcept {
  return guarded(error, error_size, [&] {
    initialise();
    auto output = OIIO::ImageOutput::create("tiff");
    if (!output) throw Failure(OIIO::geterror());
    const Kind kind = Kind(info->kind);
    for (uint32_t level = 0; level < info->levels; level++) {
      ImageSpec spec(int(info->width[level]), int(info->height[level]), 4, type_of(kind));
      spec.tile_width = spec.tile_height = 64;
      spec.attribute("compression", "none");
      spec.attribute("oiio:UnassociatedAlpha", 1);
      // The format knows images only; with this they are read as the levels of one.
      spec.attribute("textureformat", "Plain Texture");
      const auto next = output->supports("mipmap") ? OIIO::ImageOutput::AppendMIPLevel : OIIO::ImageOutput::AppendSubimage;
      const auto mode = level == 0 ? OIIO::ImageOutput::Create : next;
      if (!output->open(path, spec, mode) || !output->write_image(type_of(kind), levels[level])) {
        throw Failure(output->geterror());
      }
    }
    if (!output->close()) throw Failure(output->geterror());
  });
}

namespace {

// Hands free memory back to the system. A tile is freed by another thread than the one that needs the next, which has a heap
// of its own: without this the process grows far beyond what the cache holds.
void give_back() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

struct Image {
  ImageCache::ImageHandle* handle;
  Kind kind;
  int channels;
  std::vector<ImageSpec> levels;
};

// A tile that a thread holds.
struct Held {
  uint64_t key = ~uint64_t(0);
  ImageCache::Tile* tile = nullptr;
  const unsigned char* pixels = nullptr;
  size_t bytes = 0;
};

// Counts of one thread; read by others.
struct Counts {
  std::atomic<uint64_t> requests{0}, front_misses{0};
};

// What the cache and the threads that look into it own together. The last of them ends it.
struct Shared {
  ImageCache* cache = nullptr;
  std::vector<Image> images;
  uint64_t serial = 0;
  size_t hold_limit = 0;
  size_t give_back_after = 0;
  std::atomic<size_t> fetched{0};
  std::atomic<size_t> held{0};
  std::atomic<uint64_t> peak{0};
  std::mutex threads_lock;
  std::vector<std::shared_ptr<Counts>> threads;

  ~Shared() {
    if (cache) ImageCache::destroy(cache, true);
  }

  void look_at_memory() {
    OIIO::imagesize_t bytes = 0;
    if (!cache->getattribute("stat:cache_memory_used", TypeDesc::INT64, &bytes)) return;
    uint64_t before = peak.load(std::memory_order_relaxed);
    while (before < bytes && !peak.compare_exchange_weak(before, bytes, std::memory_order_relaxed)) {
    }
  }
};

constexpr size_t HELD = 64;
constexpr uint64_t LOOK_EVERY = 64;

// The tiles that a thread saw last, so that most texels need no lock. Of one cache at a time.
struct Thread {
  std::shared_ptr<Shared> of;
  std::shared_ptr<Counts> counts;
  ImageCache::Perthread* perthread = nullptr;
  std::array<Held, HELD> held;

  ~Thread() { leave(); }

  void release(Held& slot) {
    if (slot.tile) {
      of->cache->release_tile(slot.tile);
      of->held.fetch_sub(slot.bytes, std::memory_order_relaxed);
      slot = Held();
    }
  }

  void leave() {
    if (!of) return;
    for (Held& slot : held) release(slot);
    of.reset();
    perthread = nullptr;
  }

  void enter(const std::shared_ptr<Shared>& shared) {
    leave();
    auto mine = std::make_shared<Counts>();
    {
      std::lock_guard<std::mutex> lock(shared->threads_lock);
      shared->threads.push_back(mine);
    }
    of = shared;
    counts = mine;
    perthread = shared->cache->get_perthread_info();
  }

  // The pixels of the tile that holds a texel. `slot` is used where the tile may not be held.
  const Held& tile(uint32_t image, uint32_t level, int x, int y, Held& spare) {
    const Image& picture = of->images[image];
    const ImageSpec& spec = picture.levels[level];
    const uint64_t column = uint64_t(x) / uint64_t(spec.tile_width), row = uint64_t(y) / uint64_t(spec.tile_height);
    const uint64_t key = (uint64_t(image) << 40) ^ (uint64_t(level) << 35) ^ (row << 17) ^ column;
    Held& slot = held[(key * 0x9E3779B97F4A7C15ull) >> 58];
    if (slot.key == key) return slot;

    const uint64_t misses = counts->front_misses.load(std::memory_order_relaxed);
    counts->front_misses.store(misses + 1, std::memory_order_relaxed);
    if (misses % LOOK_EVERY == 0) of->look_at_memory();
    ImageCache::Tile* found = of->cache->get_tile(picture.handle, perthread, 0, int(level), spec.x + x, spec.y + y, spec.z);
    if (!found) throw Failure(of->cache->geterror());
    TypeDesc format;
    const void* pixels = of->cache->tile_pixels(found, format);
    if (!pixels || kind_of(format) != picture.kind) {
      of->cache->release_tile(found);
      throw Failure("the tile cannot be read");
    }
    Held taken;
    taken.key = key;
    taken.tile = found;
    taken.pixels = static_cast<const unsigned char*>(pixels);
    taken.bytes = size_t(spec.tile_width) * size_t(spec.tile_height) * size_t(picture.channels) * size_of(picture.kind);
    release(slot);
    const size_t before = of->fetched.fetch_add(taken.bytes, std::memory_order_relaxed);
    if (before / of->give_back_after != (before + taken.bytes) / of->give_back_after) give_back();
    if (of->held.load(std::memory_order_relaxed) + taken.bytes > of->hold_limit) {
      for (Held& other : held) release(other);
    }
    if (of->held.load(std::memory_order_relaxed) + taken.bytes > of->hold_limit) {
      spare = taken;
      return spare;
    }
    of->held.fetch_add(taken.bytes, std::memory_order_relaxed);
    slot = taken;
    return slot;
  }
};

thread_local Thread this_thread;
std::atomic<uint64_t> next_serial{1};

}  // namespace

struct pathspace_oiio_cache {
  std::shared_ptr<Shared> shared;
};

pathspace_oiio_cache* pathspace_oiio_cache_new(uint64_t max_bytes) noexcept {
  pathspace_oiio_cache* made = nullptr;
  guarded(nullptr, 0, [&] {
    initialise();
    auto shared = std::make_shared<Shared>();
    shared->cache = ImageCache::create(false);
    if (!shared->cache) throw Failure("no cache");
    shared->serial = next_serial++;
    shared->hold_limit = size_t(max_bytes / 8);
    shared->give_back_after = std::max(size_t(max_bytes / 16), size_t(1) << 20);
    shared->cache->attribute("max_memory_MB", float(double(max_bytes) / double(1 << 20)));
    shared->cache->attribute("max_open_files", 256);
    shared->cache->attribute("unassociatedalpha", 1);
    shared->cache->attribute("forcefloat", 0);
    shared->cache->attribute("automip", 0);
    made = new pathspace_oiio_cache{std::move(shared)};
  });
  return made;
}

int pathspace_oiio_cache_add(pathspace_oiio_cache* cache, const char* path, uint32_t* image, char* error,
                             size_t error_size) noexcept {
  return guarded(error, error_size, [&] {
    Shared& shared = *cache->shared;
    Image added;
    added.handle = shared.cache->get_image_handle(OIIO::ustring(path));
    if (!added.handle || !shared.cache->good(added.handle)) throw Failure(shared.cache->geterror());
    for (int level = 0; level < PATHSPACE_OIIO_LEVELS; level++) {
      ImageSpec spec;
      if (!shared.cache->get_imagespec(added.handle, nullptr, spec, 0, level)) break;
      if (spec.tile_width < 1 || spec.tile_height < 1) throw Failure("the file is not tiled");
      added.levels.push_back(spec);
    }
    (void)shared.cache->geterror();
    if (added.levels.empty()) throw Failure("no image in the file");
    check(added.levels[0]);
    added.kind = kind_of(added.levels[0].format);
    added.channels = added.levels[0].nchannels;
    *image = uint32_t(shared.images.size());
    shared.images.push_back(std::move(added));
    // What decoding and copying freed must not stand beside what the cache will take.
    give_back();
  });
}

int pathspace_oiio_texels(pathspace_oiio_cache* cache, uint32_t image, size_t count, const pathspace_oiio_texel* wanted,
                          void* texels, char* error, size_t error_size) noexcept {
  return guarded(error, error_size, [&] {
    Thread& thread = this_thread;
    if (!thread.of || thread.of->serial != cache->shared->serial) thread.enter(cache->shared);
    Counts& counts = *thread.counts;
    counts.requests.store(counts.requests.load(std::memory_order_relaxed) + count, std::memory_order_relaxed);
    if (image >= cache->shared->images.size()) throw Failure("no such image");
    const Image& picture = cache->shared->images[image];
    const size_t from_size = size_of(picture.kind) * size_t(picture.channels);
    auto* to = static_cast<unsigned char*>(texels);
    for (size_t i = 0; i < count; i++, to += texel_size(picture.kind)) {
      const pathspace_oiio_texel& w = wanted[i];
      if (w.level >= picture.levels.size()) throw Failure("no such level");
      const ImageSpec& spec = picture.levels[w.level];
      if (w.x >= uint32_t(spec.width) || w.y >= uint32_t(spec.height)) throw Failure("a texel outside of the image");
      Held spare;
      const Held& held = thread.tile(image, w.level, int(w.x), int(w.y), spare);
      const size_t at = size_t(w.y % uint32_t(spec.tile_height)) * size_t(spec.tile_width) + w.x % uint32_t(spec.tile_width);
      expand(picture.kind, held.pixels + at * from_size, std::min(picture.channels, 4), to);
      if (spare.tile) thread.of->cache->release_tile(spare.tile);
    }
  });
}

void pathspace_oiio_cache_stats(pathspace_oiio_cache* cache, pathspace_oiio_stats* stats) noexcept {
  guarded(nullptr, 0, [&] {
    Shared& shared = *cache->shared;
    *stats = {};
    shared.look_at_memory();
    {
      std::lock_guard<std::mutex> lock(shared.threads_lock);
      for (const auto& counts : shared.threads) stats->requests += counts->requests.load(std::memory_order_relaxed);
    }
    long long bytes = 0;
    int misses = 0;
    float seconds = 0;
    shared.cache->getattribute("stat:tiles_created", TypeDesc::INT, &misses);
    shared.cache->getattribute("stat:cache_memory_used", TypeDesc::INT64, &bytes);
    shared.cache->getattribute("stat:fileio_time", TypeDesc::FLOAT, &seconds);
    stats->tile_misses = uint64_t(std::max(misses, 0));
    stats->tile_hits = stats->requests - std::min(stats->requests, stats->tile_misses);
    stats->bytes = uint64_t(std::max(bytes, 0ll));
    stats->peak_bytes = std::max(shared.peak.load(), stats->bytes);
    stats->read_seconds = double(seconds);
  });
}

void pathspace_oiio_cache_free(pathspace_oiio_cache* cache) noexcept {
  guarded(nullptr, 0, [&] {
    if (this_thread.of == cache->shared) this_thread.leave();
    delete cache;
  });
}
