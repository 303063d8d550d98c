//! What a ray has still to visit: where it enters, and what. Entries beyond a hit found meanwhile are dropped when they
//! come up.

use super::reference::Reference;
use crate::math::simd::x8::F32x8;

/// Entries. A node leaves at most seven behind and adds eight; two levels, three more instances of a leaf and the way
/// back.
const ENTRIES: usize = 512;

/// Levels of one hierarchy that the stack allows.
pub(super) const MAX_LEVELS: usize = 34;
const _: () = assert!(BOTTOM + 2 * (7 * MAX_LEVELS + 8) + 8 <= ENTRIES);

/// Entries that are compared at once, so many lie below the bottom and are never taken.
const WINDOW: usize = 8;
const BOTTOM: usize = WINDOW - 1;

/// The stack of a ray.
#[derive(Clone, Debug)]
pub(super) struct Stack {
    /// Entries, with those below the bottom.
    len: usize,
    /// Where the ray enters; −∞ for what is always taken.
    enters: [f32; ENTRIES],
    what: [Reference; ENTRIES],
}

impl Stack {
    pub const EMPTY: Stack = {
        let mut stack = Stack { len: WINDOW, enters: [f32::INFINITY; ENTRIES], what: [Reference::DONE; ENTRIES] };
        stack.enters[BOTTOM] = f32::NEG_INFINITY;
        stack
    };

    /// Leaves [`Reference::DONE`] alone.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.len = WINDOW;
    }

    /// Adds the first `count` of eight entries, the last of them on top.
    #[inline(always)]
    pub fn push(&mut self, enters: [u32; 8], what: [u32; 8], count: u32) {
        let places = self.len..self.len + 8;
        if let (Some(to), Some(of)) = (self.enters.get_mut(places.clone()), self.what.get_mut(places)) {
            to.copy_from_slice(&bytemuck::cast::<_, [f32; 8]>(enters));
            of.copy_from_slice(&bytemuck::cast::<_, [Reference; 8]>(what));
            self.len += count as usize;
        }
    }

    /// Adds something that is taken whatever has been hit.
    pub fn push_always(&mut self, what: Reference) {
        self.enters[self.len] = f32::NEG_INFINITY;
        self.what[self.len] = what;
        self.len += 1;
    }

    /// Takes the top entry that is entered at or before `reach`, the likely one being the top.
    #[inline(always)]
    pub fn pop(&mut self, reach: f32) -> Reference {
        let mut top = (self.len - 1) % ENTRIES;
        while self.enters[top] > reach {
            top = (top - 1) % ENTRIES;
        }
        self.len = top;
        self.what[top]
    }

    /// [`Stack::pop`] where `reach` has just changed: any of the upper entries is likely, so none is guessed.
    #[inline(always)]
    pub fn pop_any(&mut self, reach: f32) -> Reference {
        let mut end = self.len.min(ENTRIES);
        loop {
            let Some(window) = end.checked_sub(WINDOW).and_then(|from| self.enters[..end].get(from..)) else {
                // The bottom is always taken, so this is never reached.
                return Reference::DONE;
            };
            let open = F32x8::of(window.try_into().unwrap_or([0.0; WINDOW])).le(F32x8::splat(reach));
            if open != 0 {
                let top = (end - 1 - open.leading_zeros() as usize) % ENTRIES;
                self.len = top;
                return self.what[top];
            }
            end -= WINDOW;
        }
    }
}
