//! Eight numbers in a register: AVX2 where the build has it (its baseline on x86-64), arrays elsewhere. Same bits from
//! both.

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
    pub struct F32x8(__m256);

    /// Eight u32.
    #[derive(Clone, Copy)]
    pub struct U32x8(__m256i);

    impl F32x8 {
        /// `x` in every lane.
        #[inline(always)]
        pub fn splat(x: f32) -> Self {
            F32x8(avx!(_mm256_set1_ps(x)))
        }

        /// The lanes of an array.
        #[inline(always)]
        pub fn of(lanes: [f32; 8]) -> Self {
            F32x8(bytemuck::cast(lanes))
        }

        /// The integers of eight bytes.
        #[inline(always)]
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            F32x8(avx!(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(bytes))))))
        }

        /// `self · a + b`, rounded once.
        #[inline(always)]
        pub fn mul_add(self, a: Self, b: Self) -> Self {
            F32x8(avx!(_mm256_fmadd_ps(self.0, a.0, b.0)))
        }

        /// The product, lane by lane.
        #[inline(always)]
        pub fn times(self, a: Self) -> Self {
            F32x8(avx!(_mm256_mul_ps(self.0, a.0)))
        }

        /// The larger; `other` where either is NaN.
        #[inline(always)]
        pub fn max(self, other: Self) -> Self {
            F32x8(avx!(_mm256_max_ps(self.0, other.0)))
        }

        /// The smaller; `other` where either is NaN.
        #[inline(always)]
        pub fn min(self, other: Self) -> Self {
            F32x8(avx!(_mm256_min_ps(self.0, other.0)))
        }

        /// Bit i: `self[i] ≤ other[i]`.
        #[inline(always)]
        pub fn le(self, other: Self) -> u8 {
            avx!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0))) as u8
        }

        /// Lane i is `self[order[i]]`.
        #[inline(always)]
        pub fn permuted(self, order: U32x8) -> Self {
            F32x8(avx!(_mm256_permutevar8x32_ps(self.0, order.0)))
        }

        /// The bits of each lane.
        #[inline(always)]
        pub fn to_bits(self) -> U32x8 {
            U32x8(avx!(_mm256_castps_si256(self.0)))
        }
    }

    impl U32x8 {
        /// The lanes of an array.
        #[inline(always)]
        pub fn of(lanes: [u32; 8]) -> Self {
            U32x8(bytemuck::cast(lanes))
        }

        /// The integers of eight bytes.
        #[inline(always)]
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            U32x8(avx!(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(bytes)))))
        }

        /// Lane i is `self[order[i]]`.
        #[inline(always)]
        pub fn permuted(self, order: U32x8) -> Self {
            U32x8(avx!(_mm256_permutevar8x32_epi32(self.0, order.0)))
        }

        /// The lanes as an array.
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
    pub struct F32x8([f32; 8]);

    /// Eight u32.
    #[derive(Clone, Copy)]
    pub struct U32x8([u32; 8]);

    impl F32x8 {
        /// `x` in every lane.
        pub fn splat(x: f32) -> Self {
            F32x8([x; 8])
        }

        /// The lanes of an array.
        pub fn of(lanes: [f32; 8]) -> Self {
            F32x8(lanes)
        }

        /// The integers of eight bytes.
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            F32x8(bytes.map(f32::from))
        }

        /// `self · a + b`, rounded once.
        pub fn mul_add(self, a: Self, b: Self) -> Self {
            F32x8(from_fn(|i| self.0[i].mul_add(a.0[i], b.0[i])))
        }

        /// The product, lane by lane.
        pub fn times(self, a: Self) -> Self {
            F32x8(from_fn(|i| self.0[i] * a.0[i]))
        }

        /// The larger; `other` where either is NaN.
        pub fn max(self, other: Self) -> Self {
            F32x8(from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
        }

        /// The smaller; `other` where either is NaN.
        pub fn min(self, other: Self) -> Self {
            F32x8(from_fn(|i| if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
        }

        /// Bit i: `self[i] ≤ other[i]`.
        pub fn le(self, other: Self) -> u8 {
            (0..8).fold(0, |mask, i| mask | u8::from(self.0[i] <= other.0[i]) << i)
        }

        /// Lane i is `self[order[i]]`.
        pub fn permuted(self, order: U32x8) -> Self {
            F32x8(order.0.map(|i| self.0[i as usize % 8]))
        }

        /// The bits of each lane.
        pub fn to_bits(self) -> U32x8 {
            U32x8(self.0.map(f32::to_bits))
        }
    }

    impl U32x8 {
        /// The lanes of an array.
        pub fn of(lanes: [u32; 8]) -> Self {
            U32x8(lanes)
        }

        /// The integers of eight bytes.
        pub fn of_bytes(bytes: [u8; 8]) -> Self {
            U32x8(bytes.map(u32::from))
        }

        /// Lane i is `self[order[i]]`.
        pub fn permuted(self, order: U32x8) -> Self {
            U32x8(order.0.map(|i| self.0[i as usize % 8]))
        }

        /// The lanes as an array.
        pub fn to_array(self) -> [u32; 8] {
            self.0
        }
    }
}

pub use lanes::{F32x8, U32x8};

#[cfg(test)]
mod tests {
    use super::*;
    use std::array::from_fn;

    /// Each operation against the same arithmetic on arrays, to the bit. Deterministic.
    #[test]
    fn lanes_are_eight_numbers() {
        let odd = [0.0, -0.0, 1.5, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, f32::MIN_POSITIVE / 2.0, -3.25e30];
        let lanes = |x: F32x8| x.to_bits().to_array();
        for turn in 0..8 {
            let (a, b): ([f32; 8], [f32; 8]) = (odd, from_fn(|i| odd[(i + turn) % 8]));
            let (x, y) = (F32x8::of(a), F32x8::of(b));
            let each = |of: &dyn Fn(f32, f32) -> f32| from_fn(|i| of(a[i], b[i]).to_bits());
            let quiet =
                |bits: [u32; 8]| bits.map(|bits| if f32::from_bits(bits).is_nan() { 0x7FC0_0000 } else { bits });
            assert_eq!(quiet(lanes(x.times(y))), quiet(each(&|a, b| a * b)));
            assert_eq!(quiet(lanes(x.mul_add(y, x))), quiet(each(&|a, b| a.mul_add(b, a))));
            assert_eq!(lanes(x.max(y)), each(&|a, b| if a > b { a } else { b }));
            assert_eq!(lanes(x.min(y)), each(&|a, b| if a < b { a } else { b }));
            assert_eq!(x.le(y), (0..8).fold(0, |mask, i| mask | u8::from(a[i] <= b[i]) << i));
            // Of an index the three lowest bits count.
            let order: [u32; 8] = from_fn(|i| (i * 3 + turn) as u32);
            assert_eq!(lanes(x.permuted(U32x8::of(order))), order.map(|i| a[i as usize % 8].to_bits()));
            assert_eq!(U32x8::of(order).permuted(U32x8::of(order)).to_array(), order.map(|i| order[i as usize % 8]));
        }
        let bytes = [0, 1, 127, 128, 255, 9, 33, 64];
        assert_eq!(lanes(F32x8::of_bytes(bytes)), bytes.map(|byte| f32::from(byte).to_bits()));
        assert_eq!(U32x8::of_bytes(bytes).to_array(), bytes.map(u32::from));
        assert_eq!(lanes(F32x8::splat(0.1)), [0.1f32.to_bits(); 8]);
    }
}
