//! Sixteen lanes as columns of numbers: the vocabulary of the kernels. A loop `for i in 0..LANES` over columns without
//! branches or calls becomes vector code: one AVX-512 register a column, or two of AVX2. ARCHITECTURE.md says how to
//! check.
//!
//! `columns!` declares a struct and its sixteen-lane form at once.

use bytemuck::{cast_mut, cast_ref};
use glam::Vec3;

use super::lanes::LANES;
use super::simd::isa::Isa;

/// One number per lane.
pub type Lane = [f32; LANES];

/// One vector per lane.
pub type Lane3 = [Lane; 3];

/// A condition per lane, 1 or 0. As wide as the numbers it selects among: loops that mix widths do not vectorise.
pub type Mask = [u32; LANES];

/// All-zero column.
pub const ZERO: Lane = [0.0; LANES];
/// See [`ZERO`].
pub const ZERO3: Lane3 = [ZERO; 3];

/// Vector of one lane.
#[inline(always)]
pub fn get(column: &Lane3, i: usize) -> Vec3 {
    Vec3::new(column[0][i], column[1][i], column[2][i])
}

/// Writes the vector of one lane.
#[inline(always)]
pub fn set(column: &mut Lane3, i: usize, v: Vec3) {
    column[0][i] = v.x;
    column[1][i] = v.y;
    column[2][i] = v.z;
}

/// The lanes of a bit mask as a column.
#[inline(always)]
pub fn spread(bits: u16) -> Mask {
    let mut mask = [0; LANES];
    for i in 0..LANES {
        mask[i] = u32::from(bits >> i) & 1;
    }
    mask
}

/// The bit mask of a column.
#[inline(always)]
pub fn bits(mask: &Mask) -> u16 {
    let mut bits = 0;
    for i in 0..LANES {
        bits |= ((mask[i] != 0) as u16) << i;
    }
    bits
}

/// A value that has a form in columns.
pub trait Column: Copy {
    /// Sixteen of them.
    type Lanes: Copy;

    /// The same value in every lane.
    fn splat(self) -> Self::Lanes;

    /// Gathers one lane.
    fn get(lanes: &Self::Lanes, i: usize) -> Self;

    /// Scatters one lane.
    fn set(lanes: &mut Self::Lanes, i: usize, value: Self);
}

/// A column of 32-bit numbers, whose lanes can be moved.
pub trait Movable: Column {
    /// See [`Isa::squeeze`].
    fn squeeze<I: Isa>(from: &Self::Lanes, keep: u16, at: usize, here: &mut Self::Lanes, after: &mut Self::Lanes);
}

/// Makes columns of types whose sixteen lanes are an array as it stands.
macro_rules! array_column {
    ($($T:ty),*) => {$(
        impl $crate::math::columns::Column for $T {
            type Lanes = [Self; $crate::math::lanes::LANES];

            #[inline(always)]
            fn splat(self) -> Self::Lanes {
                [self; $crate::math::lanes::LANES]
            }

            #[inline(always)]
            fn get(lanes: &Self::Lanes, i: usize) -> Self {
                lanes[i]
            }

            #[inline(always)]
            fn set(lanes: &mut Self::Lanes, i: usize, value: Self) {
                lanes[i] = value;
            }
        }
    )*};
}

pub(crate) use array_column;

array_column!(f32, u32, ());

impl Column for bool {
    type Lanes = Mask;

    #[inline(always)]
    fn splat(self) -> Mask {
        [u32::from(self); LANES]
    }

    #[inline(always)]
    fn get(lanes: &Mask, i: usize) -> bool {
        lanes[i] != 0
    }

    #[inline(always)]
    fn set(lanes: &mut Mask, i: usize, value: bool) {
        lanes[i] = u32::from(value);
    }
}

impl Column for Vec3 {
    type Lanes = Lane3;

    #[inline(always)]
    fn splat(self) -> Lane3 {
        self.to_array().map(|x| [x; LANES])
    }

    #[inline(always)]
    fn get(lanes: &Lane3, i: usize) -> Vec3 {
        get(lanes, i)
    }

    #[inline(always)]
    fn set(lanes: &mut Lane3, i: usize, value: Vec3) {
        set(lanes, i, value);
    }
}

impl Movable for u32 {
    #[inline(always)]
    fn squeeze<I: Isa>(from: &Mask, keep: u16, at: usize, here: &mut Mask, after: &mut Mask) {
        I::squeeze(from, keep, at, here, after);
    }
}

impl Movable for f32 {
    #[inline(always)]
    fn squeeze<I: Isa>(from: &Lane, keep: u16, at: usize, here: &mut Lane, after: &mut Lane) {
        I::squeeze(cast_ref(from), keep, at, cast_mut(here), cast_mut(after));
    }
}

impl Movable for Vec3 {
    #[inline(always)]
    fn squeeze<I: Isa>(from: &Lane3, keep: u16, at: usize, here: &mut Lane3, after: &mut Lane3) {
        for c in 0..3 {
            f32::squeeze::<I>(&from[c], keep, at, &mut here[c], &mut after[c]);
        }
    }
}

/// Declares a struct of columns: `columns! { pub struct One as Lanes { field: Type, … } }` makes both and
/// implements [`Column`].
///
/// `columns! { moved by Carried; … }` also gives `Lanes` a method `squeeze` that moves the lanes of every field; a
/// field `name: Type => gate` only where `carried.gate` is true, and else keeps the values it has.
macro_rules! columns {
    (moved by $Carried:ty; $(#[$m:meta])* $v:vis struct $One:ident as $Lanes:ident {
        $($(#[$fm:meta])* $f:ident: $T:ty $(=> $gate:ident)?,)*
    }) => {
        $crate::math::columns::columns! { $(#[$m])* $v struct $One as $Lanes { $($(#[$fm])* $f: $T,)* } }

        impl $Lanes {
            /// Puts the lanes that `keep` marks behind one another, from lane `at` of `here` on and then into `after`.
            #[inline(always)]
            $v fn squeeze<I: $crate::math::simd::isa::Isa>(
                &self,
                keep: u16,
                at: usize,
                [here, after]: [&mut Self; 2],
                carried: $Carried,
            ) {
                let _ = carried;
                $(if true $(&& carried.$gate)? {
                    <$T as $crate::math::columns::Movable>::squeeze::<I>(
                        &self.$f, keep, at, &mut here.$f, &mut after.$f,
                    );
                })*
            }
        }
    };
    ($(#[$m:meta])* $v:vis struct $One:ident $(<$t:lifetime>)? as $Lanes:ident {
        $($(#[$fm:meta])* $f:ident: $T:ty,)*
    }) => {
        $(#[$m])*
        #[derive(Clone, Copy)]
        $v struct $One $(<$t>)? {
            $($(#[$fm])* pub $f: $T,)*
        }

        #[doc = concat!("Sixteen of [`", stringify!($One), "`], in columns.")]
        #[repr(C, align(64))]
        #[derive(Clone, Copy)]
        $v struct $Lanes $(<$t>)? {
            $($(#[$fm])* pub $f: <$T as $crate::math::columns::Column>::Lanes,)*
        }

        impl $(<$t>)? $crate::math::columns::Column for $One $(<$t>)? {
            type Lanes = $Lanes $(<$t>)?;

            #[inline(always)]
            fn splat(self) -> Self::Lanes {
                $Lanes { $($f: <$T as $crate::math::columns::Column>::splat(self.$f),)* }
            }

            #[inline(always)]
            fn get(lanes: &Self::Lanes, i: usize) -> Self {
                $One { $($f: <$T as $crate::math::columns::Column>::get(&lanes.$f, i),)* }
            }

            #[inline(always)]
            fn set(lanes: &mut Self::Lanes, i: usize, value: Self) {
                $(<$T as $crate::math::columns::Column>::set(&mut lanes.$f, i, value.$f);)*
            }
        }
    };
}

pub(crate) use columns;
