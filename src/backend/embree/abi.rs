//! The seam between Embree 3 and 4: the only file that knows which one is installed. The rest of the folder is written
//! for 4; here 3 adapts.
//!
//! What differs: 4 passes arguments after the ray where 3 passes a context before it, 4 has no stream calls, 4.3 has
//! one more hit column. What does not: the structures' order, checked against ours at compile time below.

use std::mem::{align_of, offset_of, size_of};

pub(super) use pathspace_embree_sys as sys;
use sys::{RTCHit16, RTCRay16, RTCRayHit, RTCRayHit4, RTCRayHit8, RTCRayHit16, RTCScene};

use crate::backend::Coherence;
use crate::backend::batch::{HitBlock, INVALID_ID, LANES, RayBlock, RayHitBlock};
use crate::backend::past::{Key, key_of};

/// Whether this Embree traces streams natively.
pub(super) const HAS_STREAMS: bool = cfg!(embree_major = "3");

/// Which lanes of a packet are traced: −1 or 0 each. Embree reads the mask of 16 lanes with an aligned load.
#[repr(C, align(64))]
pub(super) struct Lanes([i32; LANES]);

impl Lanes {
    /// From a bit mask.
    #[inline(always)]
    pub(super) fn from_bits(bits: u16) -> Self {
        Lanes(std::array::from_fn(|lane| -i32::from((bits >> lane) & 1)))
    }
}

/// `N` rays, the layout of `RTCRay4` and `RTCRay8`.
#[repr(C, align(64))]
pub(super) struct Rays<const N: usize> {
    pub(super) org: [[f32; N]; 3],
    pub(super) tnear: [f32; N],
    pub(super) dir: [[f32; N]; 3],
    pub(super) time: [f32; N],
    pub(super) tfar: [f32; N],
    pub(super) mask: [u32; N],
    pub(super) id: [u32; N],
    pub(super) flags: [u32; N],
}

/// `N` hits, the layout of `RTCHit4` and `RTCHit8` of 4.3 and at least that of older ones.
#[repr(C)]
pub(super) struct Hits<const N: usize> {
    pub(super) ng: [[f32; N]; 3],
    pub(super) uv: [[f32; N]; 2],
    pub(super) prim: [u32; N],
    pub(super) geom: [u32; N],
    pub(super) inst: [u32; N],
    pub(super) inst_prim: [u32; N],
}

/// `N` rays and their hits, the layout of `RTCRayHit4` and `RTCRayHit8`.
#[repr(C, align(64))]
pub(super) struct RayHits<const N: usize> {
    pub(super) ray: Rays<N>,
    pub(super) hit: Hits<N>,
}

/// One packet width: ours must be at least as large and aligned as Embree's, with every column where Embree looks.
macro_rules! assert_packet {
    ($n:literal, $rayhit:ty, $ray:ty, $hit:ty) => {
        const _: () = {
            assert!(size_of::<RayHits<$n>>() >= size_of::<$rayhit>() && size_of::<Rays<$n>>() >= size_of::<$ray>());
            assert!(align_of::<Rays<$n>>() >= align_of::<$ray>() && align_of::<Rays<$n>>() >= align_of::<$rayhit>());
            assert!(offset_of!(RayHits<$n>, hit) == offset_of!($rayhit, hit));
            assert!(offset_of!(Rays<$n>, org) == offset_of!($ray, org_x));
            assert!(offset_of!(Rays<$n>, tnear) == offset_of!($ray, tnear));
            assert!(offset_of!(Rays<$n>, dir) == offset_of!($ray, dir_x));
            assert!(offset_of!(Rays<$n>, tfar) == offset_of!($ray, tfar));
            assert!(offset_of!(Rays<$n>, mask) == offset_of!($ray, mask));
            assert!(offset_of!(Rays<$n>, flags) == offset_of!($ray, flags));
            assert!(offset_of!(Hits<$n>, ng) == offset_of!($hit, Ng_x));
            assert!(offset_of!(Hits<$n>, uv) == offset_of!($hit, u));
            assert!(offset_of!(Hits<$n>, prim) == offset_of!($hit, primID));
            assert!(offset_of!(Hits<$n>, geom) == offset_of!($hit, geomID));
            assert!(offset_of!(Hits<$n>, inst) == offset_of!($hit, instID));
        };
    };
}
assert_packet!(4, RTCRayHit4, sys::RTCRay4, sys::RTCHit4);
assert_packet!(8, RTCRayHit8, sys::RTCRay8, sys::RTCHit8);

// The blocks of the whole program are Embree's packets of 16: the same proof, column by column.
const _: () = {
    assert!(sys::RTC_MAX_INSTANCE_LEVEL_COUNT == 1, "Embree must be built for one level of instances");
    assert!(align_of::<Lanes>() == 64 && size_of::<Lanes>() == 64);
    assert!(align_of::<RayBlock>() == 64 && align_of::<RayHitBlock>() == 64);
    assert!(align_of::<RTCRay16>() == 64 && align_of::<RTCRayHit16>() == 64);
    assert!(size_of::<RayBlock>() == size_of::<RTCRay16>());
    assert!(size_of::<RayHitBlock>() >= size_of::<RTCRayHit16>());
    assert!(offset_of!(RayHitBlock, ray) == 0 && offset_of!(RTCRayHit16, ray) == 0);
    assert!(offset_of!(RayHitBlock, hit) == offset_of!(RTCRayHit16, hit));
    assert!(offset_of!(RayBlock, org_x) == offset_of!(RTCRay16, org_x));
    assert!(offset_of!(RayBlock, org_y) == offset_of!(RTCRay16, org_y));
    assert!(offset_of!(RayBlock, org_z) == offset_of!(RTCRay16, org_z));
    assert!(offset_of!(RayBlock, tnear) == offset_of!(RTCRay16, tnear));
    assert!(offset_of!(RayBlock, dir_x) == offset_of!(RTCRay16, dir_x));
    assert!(offset_of!(RayBlock, dir_y) == offset_of!(RTCRay16, dir_y));
    assert!(offset_of!(RayBlock, dir_z) == offset_of!(RTCRay16, dir_z));
    assert!(offset_of!(RayBlock, time) == offset_of!(RTCRay16, time));
    assert!(offset_of!(RayBlock, tfar) == offset_of!(RTCRay16, tfar));
    assert!(offset_of!(RayBlock, mask) == offset_of!(RTCRay16, mask));
    assert!(offset_of!(RayBlock, id) == offset_of!(RTCRay16, id));
    assert!(offset_of!(RayBlock, flags) == offset_of!(RTCRay16, flags));
    assert!(offset_of!(HitBlock, ng_x) == offset_of!(RTCHit16, Ng_x));
    assert!(offset_of!(HitBlock, ng_y) == offset_of!(RTCHit16, Ng_y));
    assert!(offset_of!(HitBlock, ng_z) == offset_of!(RTCHit16, Ng_z));
    assert!(offset_of!(HitBlock, u) == offset_of!(RTCHit16, u));
    assert!(offset_of!(HitBlock, v) == offset_of!(RTCHit16, v));
    assert!(offset_of!(HitBlock, prim) == offset_of!(RTCHit16, primID));
    assert!(offset_of!(HitBlock, geom) == offset_of!(RTCHit16, geomID));
    assert!(offset_of!(HitBlock, inst) == offset_of!(RTCHit16, instID));
};

/// What goes with each call: Embree 4's two argument structures, or Embree 3's context. One per batch and thread,
/// because Embree 3 keeps its instance stack in it. The context comes first: [`leave_out`] finds the query by its
/// address.
#[repr(C)]
pub(super) struct Query {
    #[cfg(embree_major = "4")]
    context: sys::RTCRayQueryContext,
    #[cfg(embree_major = "4")]
    intersect: sys::RTCIntersectArguments,
    #[cfg(embree_major = "4")]
    occluded: sys::RTCOccludedArguments,
    #[cfg(embree_major = "3")]
    context: sys::RTCIntersectContext,
    /// Triangles that do not count, in queries [`without`](Query::without) some.
    passed: Vec<Key>,
}

impl Query {
    /// A query of single rays for which triangles that they have passed do not count.
    pub(super) fn without() -> Self {
        let mut query = Query::new(Coherence::Incoherent);
        #[cfg(embree_major = "4")]
        {
            let flags = query.intersect.flags.0 | INVOKE_FILTER.0;
            query.intersect.flags = sys::RTCRayQueryFlags(flags);
            query.intersect.filter = Some(leave_out);
        }
        #[cfg(embree_major = "3")]
        {
            query.context.filter = Some(leave_out);
        }
        query
    }

    /// Sets what the next ray has passed.
    #[inline]
    pub(super) fn pass(&mut self, passed: impl Iterator<Item = Key>) {
        self.passed.clear();
        self.passed.extend(passed);
    }
}

/// The scene asks the filters of queries.
#[cfg(embree_major = "4")]
const FILTERS: sys::RTCSceneFlags = sys::RTCSceneFlags::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS;
#[cfg(embree_major = "3")]
const FILTERS: sys::RTCSceneFlags = sys::RTCSceneFlags::RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION;

/// Flags of a scene: whether no ray may slip between triangles, and whether there are queries
/// [`without`](Query::without) some.
pub(super) fn scene_flags(robust: bool, filters: bool) -> sys::RTCSceneFlags {
    let flag = |is_set: bool, flag: sys::RTCSceneFlags| if is_set { flag.0 } else { 0 };
    sys::RTCSceneFlags(flag(robust, sys::RTCSceneFlags::RTC_SCENE_FLAG_ROBUST) | flag(filters, FILTERS))
}

/// Embree 4 asks the filter of a query for every geometry.
#[cfg(embree_major = "4")]
const INVOKE_FILTER: sys::RTCRayQueryFlags = sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;

/// Embree's question whether a hit of [`intersect1`] counts.
unsafe extern "C" fn leave_out(args: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes arguments that live during the call.
    let args = unsafe { &*args };
    // SAFETY: the context is the first field of the query that `intersect1` was called with, by a pointer to all of it;
    // nobody writes to its `passed` during the call.
    let passed = unsafe { &*std::ptr::addr_of!((*args.context.cast::<Query>()).passed) };
    // SAFETY: a call for one ray has one hit, in the layout of RTCHit.
    let hit = unsafe { &*args.hit.cast::<sys::RTCHit>() };
    // The id of an instance in the top scene is its number + 1.
    let instance = if hit.instID[0] == INVALID_ID { 0 } else { hit.instID[0] };
    if passed.contains(&key_of(instance, hit.primID)) {
        // SAFETY: as above: one word.
        unsafe { args.valid.write(0) };
    }
}

#[cfg(embree_major = "4")]
impl Query {
    /// What `rtcInitIntersectArguments` and `rtcInitOccludedArguments` set (inline in the header), plus the hint.
    pub(super) fn new(hint: Coherence) -> Self {
        let flags = match hint {
            Coherence::Coherent => sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_COHERENT,
            Coherence::Incoherent => sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_INCOHERENT,
        };
        let feature_mask = sys::RTCFeatureFlags::RTC_FEATURE_FLAG_ALL;
        Query {
            context: sys::RTCRayQueryContext { instID: [INVALID_ID], ..Default::default() },
            passed: Vec::new(),
            intersect: sys::RTCIntersectArguments { flags, feature_mask, ..Default::default() },
            occluded: sys::RTCOccludedArguments { flags, feature_mask, ..Default::default() },
        }
    }
}

#[cfg(embree_major = "3")]
impl Query {
    /// What `rtcInitIntersectContext` sets (inline in the header), plus the hint.
    pub(super) fn new(hint: Coherence) -> Self {
        let flags = match hint {
            Coherence::Coherent => sys::RTCIntersectContextFlags::RTC_INTERSECT_CONTEXT_FLAG_COHERENT,
            Coherence::Incoherent => sys::RTCIntersectContextFlags::RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT,
        };
        let context = sys::RTCIntersectContext { flags, instID: [INVALID_ID], ..Default::default() };
        Query { context, passed: Vec::new() }
    }
}

/// One tracing call of the C API, under its own name but with our types.
///
/// Every one has the same contract.
/// # Safety
/// `scene` is alive and committed and nobody changes it. The active lanes hold rays that `batch::valid_lanes` accepted.
macro_rules! calls {
    ($($name:ident($ray:ty) = $c:ident($raw:ty, $args:ident);)*) => {$(
        /// # Safety
        /// `scene` is alive, committed and unchanged during the call; active lanes hold valid rays.
        #[inline(always)]
        pub(super) unsafe fn $name(scene: RTCScene, valid: &Lanes, ray: &mut $ray, query: &mut Query) {
            let ray: *mut $raw = std::ptr::from_mut(ray).cast();
            // SAFETY: the caller vouches for the scene and the rays; `ray` points to memory of at least Embree's size
            // and alignment (asserted above); the mask has 16 aligned words, of which the call reads its width.
            #[cfg(embree_major = "4")]
            unsafe { sys::$c(valid.0.as_ptr(), scene, ray, &mut query.$args) };
            // SAFETY: as above; the context belongs to this thread.
            #[cfg(embree_major = "3")]
            unsafe { sys::$c(valid.0.as_ptr(), scene, &mut query.context, ray) };
        }
    )*};
}
calls! {
    intersect4(RayHits<4>) = rtcIntersect4(RTCRayHit4, intersect);
    intersect8(RayHits<8>) = rtcIntersect8(RTCRayHit8, intersect);
    intersect16(RayHitBlock) = rtcIntersect16(RTCRayHit16, intersect);
    occluded4(Rays<4>) = rtcOccluded4(sys::RTCRay4, occluded);
    occluded8(Rays<8>) = rtcOccluded8(sys::RTCRay8, occluded);
    occluded16(RayBlock) = rtcOccluded16(RTCRay16, occluded);
}

/// # Safety
/// `scene` is alive, committed and unchanged during the call; the ray is valid.
#[inline(always)]
pub(super) unsafe fn intersect1(scene: RTCScene, ray: &mut RTCRayHit, query: &mut Query) {
    let whole = std::ptr::from_mut(query);
    // SAFETY: the caller vouches for the scene and the ray; the type is Embree's own. The context is the query's first
    // field, reached by a pointer to all of it.
    #[cfg(embree_major = "4")]
    unsafe {
        if (*whole).intersect.filter.is_some() {
            (*whole).intersect.context = whole.cast();
        }
        sys::rtcIntersect1(scene, ray, std::ptr::addr_of_mut!((*whole).intersect))
    };
    // SAFETY: as above; the context belongs to this thread.
    #[cfg(embree_major = "3")]
    unsafe {
        sys::rtcIntersect1(scene, whole.cast(), ray)
    };
}

/// # Safety
/// `scene` is alive, committed and unchanged during the call; the ray is valid.
#[inline(always)]
pub(super) unsafe fn occluded1(scene: RTCScene, ray: &mut sys::RTCRay, query: &mut Query) {
    // SAFETY: the caller vouches for the scene and the ray; the type is Embree's own.
    #[cfg(embree_major = "4")]
    unsafe {
        sys::rtcOccluded1(scene, ray, &mut query.occluded)
    };
    // SAFETY: as above; the context belongs to this thread.
    #[cfg(embree_major = "3")]
    unsafe {
        sys::rtcOccluded1(scene, &mut query.context, ray)
    };
}

/// Traces whole blocks as one stream: natively on 3, one packet after the other on 4.
/// # Safety
/// `scene` is alive, committed and unchanged during the call; every lane of every block holds a valid ray.
pub(super) unsafe fn intersect_stream(scene: RTCScene, blocks: &mut [RayHitBlock], query: &mut Query) {
    #[cfg(embree_major = "4")]
    for block in blocks {
        // SAFETY: the caller vouches for the scene and all sixteen rays.
        unsafe { intersect16(scene, &Lanes::from_bits(u16::MAX), block, query) };
    }
    #[cfg(embree_major = "3")]
    {
        let rays: *mut sys::RTCRayHitN = blocks.as_mut_ptr().cast();
        let (lanes, count) = (LANES as u32, u32::try_from(blocks.len()).expect("a batch has fewer than 2^32 blocks"));
        // SAFETY: the caller vouches for the scene and the rays; a block is an RTCRayHit16, which is the layout that
        // this call calls N = 16, and `count` blocks follow each other at the stride of the slice.
        unsafe { sys::rtcIntersectNM(scene, &mut query.context, rays, lanes, count, size_of::<RayHitBlock>()) };
    }
}

/// Traces rays one after the other as one stream, for any hit: natively on 3, a call each on 4. On 3 this layout lets
/// Embree sort the stream; the one of [`intersect_stream`] makes it trace packets as they are.
/// # Safety
/// `scene` is alive, committed and unchanged during the call; every ray is valid.
pub(super) unsafe fn occluded_stream(scene: RTCScene, rays: &mut [sys::RTCRay], query: &mut Query) {
    #[cfg(embree_major = "4")]
    for ray in rays {
        // SAFETY: the caller vouches for the scene and the ray.
        unsafe { occluded1(scene, ray, query) };
    }
    #[cfg(embree_major = "3")]
    {
        let count = u32::try_from(rays.len()).expect("a batch has fewer than 2^32 rays");
        let stride = size_of::<sys::RTCRay>();
        // SAFETY: the caller vouches for the scene and the rays; `count` of them follow each other at the slice's
        // stride.
        unsafe { sys::rtcOccluded1M(scene, &mut query.context, rays.as_mut_ptr(), count, stride) };
    }
}
