//! Eight numbers in a register: AVX2 where the build has it (its baseline on x86-64), arrays elsewhere. Same bits from both.

#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
mod lanes {
    use std::arch::x86_64::*;

    /// One instruction, or a few, of AVX2 and FMA on numbers.
    macro_rules! avx {
        ($value:expr) => {
            // SAFETY: this module is built only where the whole build may use these instructions.
            unsafe { $value }
        };
    }

    /// Eight f32.
    #[derive(Clone, Copy)]
    pub struct F8(__m256);

    /// Eight u32.
    #[derive(Clone, Copy)]
    pub struct U8(__m256i);

    impl F8 {
        #[inline(always)]
        pub fn splat(x: f32) -> Self {
            F8(avx!(_mm256_set1_ps(x)))
        }

        #[inline(always)]
        pub fn of(lanes: [f32; 8]) -> Self {
            F8(bytemuck::cast(lanes))
        }

        /// The integers of eight bytes.
        #[inline(always)]
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            F8(avx!(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(bytes))))))
        }

        /// `self · a + b`, rounded once.
        #[inline(always)]
        pub fn mul_add(self, a: Self, b: Self) -> Self {
            F8(avx!(_mm256_fmadd_ps(self.0, a.0, b.0)))
        }

        #[inline(always)]
        pub fn times(self, a: Self) -> Self {
            F8(avx!(_mm256_mul_ps(self.0, a.0)))
        }

        /// The larger; `other` where either is NaN.
        #[inline(always)]
        pub fn max(self, other: Self) -> Self {
            F8(avx!(_mm256_max_ps(self.0, other.0)))
        }

        /// The smaller; `other` where either is NaN.
        #[inline(always)]
        pub fn min(self, other: Self) -> Self {
            F8(avx!(_mm256_min_ps(self.0, other.0)))
        }

        /// Bit i: `self[i] ≤ other[i]`.
        #[inline(always)]
        pub fn le(self, other: Self) -> u8 {
            avx!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0))) as u8
        }

        /// Lane i is `self[order[i]]`.
        #[inline(always)]
        pub fn permuted(self, order: U8) -> Self {
            F8(avx!(_mm256_permutevar8x32_ps(self.0, order.0)))
        }

        #[inline(always)]
        pub fn to_bits(self) -> U8 {
            U8(avx!(_mm256_castps_si256(self.0)))
        }
    }

    impl U8 {
        #[inline(always)]
        pub fn of(lanes: [u32; 8]) -> Self {
            U8(bytemuck::cast(lanes))
        }

        /// The integers of eight bytes.
        #[inline(always)]
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            U8(avx!(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(bytes)))))
        }

        /// Lane i is `self[order[i]]`.
        #[inline(always)]
        pub fn permuted(self, order: U8) -> Self {
            U8(avx!(_mm256_permutevar8x32_epi32(self.0, order.0)))
        }

        #[inline(always)]
        pub fn to_array(self) -> [u32; 8] {
            bytemuck::cast(self.0)
        }
    }
}

#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
mod lanes {
    use std::array::from_fn;

    /// Eight f32.
    #[derive(Clone, Copy)]
    pub struct F8([f32; 8]);

    /// Eight u32.
    #[derive(Clone, Copy)]
    pub struct U8([u32; 8]);

    impl F8 {
        pub fn splat(x: f32) -> Self {
            F8([x; 8])
        }

        pub fn of(lanes: [f32; 8]) -> Self {
            F8(lanes)
        }

        /// The integers of eight bytes.
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            F8(bytes.map(f32::from))
        }

        /// `self · a + b`, rounded once.
        pub fn mul_add(self, a: Self, b: Self) -> Self {
            F8(from_fn(|i| self.0[i].mul_add(a.0[i], b.0[i])))
        }

        pub fn times(self, a: Self) -> Self {
            F8(from_fn(|i| self.0[i] * a.0[i]))
        }

        /// The larger; `other` where either is NaN.
        pub fn max(self, other: Self) -> Self {
            F8(from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
        }

        /// The smaller; `other` where either is NaN.
        pub fn min(self, other: Self) -> Self {
            F8(from_fn(|i| if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
        }

        /// Bit i: `self[i] ≤ other[i]`.
        pub fn le(self, other: Self) -> u8 {
            (0..8).fold(0, |mask, i| mask | u8::from(self.0[i] <= other.0[i]) << i)
        }

        /// Lane i is `self[order[i]]`.
        pub fn permuted(self, order: U8) -> Self {
            F8(order.0.map(|i| self.0[i as usize % 8]))
        }

        pub fn to_bits(self) -> U8 {
            U8(self.0.map(f32::to_bits))
        }
    }

    impl U8 {
        pub fn of(lanes: [u32; 8]) -> Self {
            U8(lanes)
        }

        /// The integers of eight bytes.
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            U8(bytes.map(u32::from))
        }

        /// Lane i is `self[order[i]]`.
        pub fn permuted(self, order: U8) -> Self {
            U8(order.0.map(|i| self.0[i as usize % 8]))
        }

        pub fn to_array(self) -> [u32; 8] {
            self.0
        }
    }
}

pub(super) use lanes::{F8, U8};
