//! Noise of the film's unit tests.

/// PCG-XSH-RR 64/32 with the increment of the reference's default stream.
pub(super) struct Pcg(pub u64);

impl Pcg {
    pub fn next(&mut self) -> f32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let bits = (((old >> 18) ^ old) >> 27) as u32;
        (bits.rotate_right((old >> 59) as u32) >> 8) as f32 / (1 << 24) as f32
    }
}
