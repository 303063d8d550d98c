/* Stands in for Open Image Denoise 2 where it is not installed: the functions that src/film/oidn.rs calls, with the
   types of oidn.h. Devices and filters are blocks of their own, so that what is not released, or used afterwards, is
   seen by valgrind. "Filtering" adds up: colour + 2 albedo + 4 normal. */

#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

struct device {
  const char *error;
  bool committed;
};

struct filter {
  struct device *device;
  const float *color, *albedo, *normal;
  float *output;
  size_t width, height;
  bool hdr, committed;
};

struct device *oidnNewDevice(int type) { return type == 1 ? calloc(1, sizeof(struct device)) : NULL; }

void oidnSetDeviceBool(struct device *device, const char *name, bool value) {
  if (strcmp(name, "setAffinity") != 0 || value) device->error = "an unknown switch";
}

void oidnSetDeviceInt(struct device *device, const char *name, int value) {
  if (strcmp(name, "numThreads") != 0 || value < 0) device->error = "an unknown number";
  if (value == 99) device->error = "too many threads";
}

int oidnGetDeviceInt(struct device *device, const char *name) {
  return device->committed && strcmp(name, "version") == 0 ? 20304 : 0;
}

void oidnCommitDevice(struct device *device) { device->committed = true; }

int oidnGetDeviceError(struct device *device, const char **text) {
  const char *error = device ? device->error : NULL;
  *text = error;
  if (device) device->error = NULL;
  return error ? 1 : 0;
}

void oidnReleaseDevice(struct device *device) { free(device); }

struct filter *oidnNewFilter(struct device *device, const char *type) {
  if (strcmp(type, "RT") != 0) return NULL;
  struct filter *filter = calloc(1, sizeof(struct filter));
  filter->device = device;
  return filter;
}

void oidnSetSharedFilterImage(struct filter *filter, const char *name, void *image, int format, size_t width,
                              size_t height, size_t offset, size_t pixel, size_t row) {
  if (format != 3 || offset || pixel || row) filter->device->error = "an unknown format";
  if (strcmp(name, "color") == 0) filter->color = image;
  if (strcmp(name, "albedo") == 0) filter->albedo = image;
  if (strcmp(name, "normal") == 0) filter->normal = image;
  if (strcmp(name, "output") == 0) filter->output = image;
  filter->width = width;
  filter->height = height;
}

void oidnSetFilterBool(struct filter *filter, const char *name, bool value) {
  if (strcmp(name, "hdr") == 0) filter->hdr = value;
}

void oidnCommitFilter(struct filter *filter) { filter->committed = true; }

void oidnExecuteFilter(struct filter *filter) {
  if (!filter->committed || !filter->hdr || !filter->color || !filter->output) {
    filter->device->error = "an image is missing";
    return;
  }
  for (size_t i = 0; i < 3 * filter->width * filter->height; i++) {
    filter->output[i] = filter->color[i] + (filter->albedo ? 2.0f * filter->albedo[i] : 0.0f) +
                        (filter->normal ? 4.0f * filter->normal[i] : 0.0f);
  }
}

void oidnReleaseFilter(struct filter *filter) { free(filter); }
