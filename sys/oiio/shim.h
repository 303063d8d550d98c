/* A C interface to OpenImageIO: what pathspace needs of it, and nothing that C cannot say.
 *
 * Every function catches whatever is thrown. Those that can fail return 0 for success, 1 for failure, and write a
 * message that ends in 0 into `error` (`error_size` bytes, cut if need be). Nothing here keeps a pointer of the
 * caller's, but a reader that was opened on bytes, until it is closed. A reader is used by one thread at a time.
 *
 * Texels are RGBA, row-major from the top: 8 bits a channel for images of kind 0, floats for all others. Grey is put
 * into R, G and B; A is 1 where the image has none. Values are those of the file, integers of 16 bits divided by 65535;
 * no curve is applied and nothing is multiplied by alpha. */

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
  uint32_t tile_width, tile_height;        /* of every level; 0 where the file is stored by scan lines */
  uint32_t levels;                         /* of the pyramid, 1 at least */
  uint32_t width[PATHSPACE_OIIO_LEVELS];   /* of each level */
  uint32_t height[PATHSPACE_OIIO_LEVELS];
  char format[32];                         /* OpenImageIO's name of the format: "png", "openexr" */
};

struct pathspace_oiio_reader;

/* The version of the library that runs and the file that it was loaded from. */
void pathspace_oiio_version(char* version, size_t version_size, char* file, size_t file_size) PATHSPACE_NOEXCEPT;

/* Opens the image file `name` as one of `format` (OpenImageIO's name or a usual extension: "png", "tif"); if `bytes` is
 * not null, the image in these bytes. No other format is tried. */
int pathspace_oiio_open(const char* name, const char* format, const void* bytes, size_t size,
                        struct pathspace_oiio_reader** reader, struct pathspace_oiio_info* info, char* error,
                        size_t error_size) PATHSPACE_NOEXCEPT;

/* Reads an area of a level, columns [area[0], area[1]) and rows [area[2], area[3]), into `texels`. In a tiled file it
 * begins and ends at edges of tiles or of the level; in any other, it is all columns. A level that is not as `info`
 * said is refused. */
int pathspace_oiio_read(struct pathspace_oiio_reader* reader, uint32_t level, const uint32_t* area, void* texels,
                        char* error, size_t error_size) PATHSPACE_NOEXCEPT;

void pathspace_oiio_close(struct pathspace_oiio_reader* reader) PATHSPACE_NOEXCEPT;

#ifdef __cplusplus
}
#endif

#endif
