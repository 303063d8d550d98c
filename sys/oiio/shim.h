/* A C interface to OpenImageIO: what pathspace needs of it, and nothing that C cannot say.
 *
 * Every function catches whatever is thrown. Those that can fail return 0 for success, 1 for failure, and write a message that
 * ends in 0 into `error` (`error_size` bytes, cut if need be). Images within a cache are numbers from 0. Nothing here
 * keeps a pointer of the caller's, but a reader that was opened on bytes, until it is closed.
 *
 * Texels are RGBA, row-major from the top: 8 bits a channel for images of kind 0, floats for all others. Grey is put
 * into R, G and B; A is 1 where the image has none. Values are those of the file, integers of 16 bits divided by 65535; no
 * curve is applied and nothing is multiplied by alpha. */

#ifndef PATHSPACE_OIIO_SHIM_H
#define PATHSPACE_OIIO_SHIM_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#define PATHSPACE_NOEXCEPT noexcept
#else
#define PATHSPACE_NOEXCEPT
#endif

enum { PATHSPACE_OIIO_LEVELS = 24 };

struct pathspace_oiio_info {
  uint32_t channels;                       /* in the file */
  uint32_t kind;                           /* 0: 8 bits, 1: integers of 16 bits, 2: half, 3: float and all else */
  uint32_t tile_width, tile_height;        /* 0 where the file is stored by scan lines */
  uint32_t levels;                         /* of the pyramid, 1 at least */
  uint32_t width[PATHSPACE_OIIO_LEVELS];   /* of each level */
  uint32_t height[PATHSPACE_OIIO_LEVELS];
  char format[32];                         /* OpenImageIO's name of the format: "png", "openexr" */
};

/* A texel of a level. */
struct pathspace_oiio_texel {
  uint32_t level, x, y;
};

/* What a cache has done so far, over all threads. */
struct pathspace_oiio_stats {
  uint64_t requests;     /* texels asked for */
  uint64_t tile_misses;  /* tiles that were read from their files */
  uint64_t tile_hits;    /* texels served without reading */
  uint64_t bytes;        /* held at this moment */
  uint64_t peak_bytes;   /* held at the most, as far as looked at */
  double read_seconds;   /* waiting for files, over all threads */
};

struct pathspace_oiio_reader;
struct pathspace_oiio_cache;

/* The version of the library that runs and the file that it was loaded from. */
void pathspace_oiio_version(char* version, size_t version_size, char* file, size_t file_size) PATHSPACE_NOEXCEPT;

/* Opens the image file `name` as one of `format` (OpenImageIO's name or a usual extension: "png", "tif"); if `bytes` is not
 * null, the image in these bytes. No other format is tried. */
int pathspace_oiio_open(const char* name, const char* format, const void* bytes, size_t size, struct pathspace_oiio_reader** reader,
                        struct pathspace_oiio_info* info, char* error, size_t error_size) PATHSPACE_NOEXCEPT;

/* Reads the rows [begin, end) of a level into `texels`. In a tiled file `begin` is a multiple of `tile_height`, `end` too or the
 * height. */
int pathspace_oiio_read(struct pathspace_oiio_reader* reader, uint32_t level, uint32_t begin, uint32_t end, void* texels,
                        char* error, size_t error_size) PATHSPACE_NOEXCEPT;

void pathspace_oiio_close(struct pathspace_oiio_reader* reader) PATHSPACE_NOEXCEPT;

/* Writes a tiled TIFF with the given levels of kind 0 or 3. Of `info` only kind, levels, width and height are read. */
int pathspace_oiio_write(const char* path, const struct pathspace_oiio_info* info, const void* const* levels, char* error,
                         size_t error_size) PATHSPACE_NOEXCEPT;

/* A tile cache that holds at most `max_bytes`; null if there is no memory. */
struct pathspace_oiio_cache* pathspace_oiio_cache_new(uint64_t max_bytes) PATHSPACE_NOEXCEPT;

/* Adds a file that stays as it is for the life of the cache; `image` is its number. */
int pathspace_oiio_cache_add(struct pathspace_oiio_cache* cache, const char* path, uint32_t* image, char* error,
                             size_t error_size) PATHSPACE_NOEXCEPT;

/* Texels of one image, in the order of `wanted`: 4 or 16 bytes each. May be called by any number of threads at once. */
int pathspace_oiio_texels(struct pathspace_oiio_cache* cache, uint32_t image, size_t count,
                          const struct pathspace_oiio_texel* wanted, void* texels, char* error,
                          size_t error_size) PATHSPACE_NOEXCEPT;

void pathspace_oiio_cache_stats(struct pathspace_oiio_cache* cache, struct pathspace_oiio_stats* stats) PATHSPACE_NOEXCEPT;

void pathspace_oiio_cache_free(struct pathspace_oiio_cache* cache) PATHSPACE_NOEXCEPT;

#ifdef __cplusplus
}
#endif

#endif
