/* Sizes, alignments and offsets as the C compiler sees them, for the test in src/layout.rs. */

#include <stddef.h>
#include PATHSPACE_EMBREE_HEADER

struct entry {
  const char* name;
  size_t value;
};

#define SIZE(type) {"sizeof " #type, sizeof(struct type)}, {"alignof " #type, _Alignof(struct type)}
#define AT(type, field) {#type "." #field, offsetof(struct type, field)}
#define RAY(type)                                                                                                \
  SIZE(type), AT(type, org_x), AT(type, org_y), AT(type, org_z), AT(type, tnear), AT(type, dir_x), AT(type, dir_y), \
      AT(type, dir_z), AT(type, time), AT(type, tfar), AT(type, mask), AT(type, id), AT(type, flags)
#define HIT(type)                                                                                               \
  SIZE(type), AT(type, Ng_x), AT(type, Ng_y), AT(type, Ng_z), AT(type, u), AT(type, v), AT(type, primID),       \
      AT(type, geomID), AT(type, instID)
#define RAYHIT(type) SIZE(type), AT(type, ray), AT(type, hit)

const struct entry pathspace_embree_layout[] = {
    RAY(RTCRay), RAY(RTCRay4), RAY(RTCRay8), RAY(RTCRay16),
    HIT(RTCHit), HIT(RTCHit4), HIT(RTCHit8), HIT(RTCHit16),
    RAYHIT(RTCRayHit), RAYHIT(RTCRayHit4), RAYHIT(RTCRayHit8), RAYHIT(RTCRayHit16),
    SIZE(RTCBounds), AT(RTCBounds, lower_x), AT(RTCBounds, upper_x), AT(RTCBounds, align1),
#if RTC_VERSION_MAJOR >= 4
    SIZE(RTCIntersectArguments), AT(RTCIntersectArguments, flags), AT(RTCIntersectArguments, feature_mask),
    AT(RTCIntersectArguments, context), AT(RTCIntersectArguments, filter), AT(RTCIntersectArguments, intersect),
    SIZE(RTCOccludedArguments), AT(RTCOccludedArguments, flags), AT(RTCOccludedArguments, feature_mask),
    AT(RTCOccludedArguments, context), AT(RTCOccludedArguments, filter), AT(RTCOccludedArguments, occluded),
#else
    SIZE(RTCIntersectContext), AT(RTCIntersectContext, flags), AT(RTCIntersectContext, filter),
    AT(RTCIntersectContext, instID),
#endif
};

const size_t pathspace_embree_layout_count = sizeof(pathspace_embree_layout) / sizeof(pathspace_embree_layout[0]);
