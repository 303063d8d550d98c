//! Cryptomatte 1.2.0: names as floats, layers of ranked ids with their coverage, and the attributes that give the names
//! back. A layer NAME is the channels `NAME00.R/G/B/A`, `NAME01…`, `NAME02…`: id and coverage of six ids a pixel, the
//! largest coverage first; coverage is the share of the pixel filter, as of the beauty. Where the filter has negative
//! lobes, it may be negative or above 1 next to edges, as radiance may. What comes after the sixth is left out.
//!
//! Source: Friedman and Jones, Cryptomatte specification 1.2.0 (Psyop); MurmurHash3_x86_32 by Appleby. Names are
//! hashed with seed 0 in UTF-8; where the exponent would be that of an infinity, a NaN or a denormal number, its lowest
//! bit is flipped.

use std::collections::BTreeMap;

use super::ids::Ids;

/// Ids of a pixel in a file.
pub const LEVELS: usize = 6;

/// Digits of a layer's hash in the names of its attributes, which OpenEXR limits to 31 bytes.
const KEY_DIGITS: usize = 7;

/// MurmurHash3_x86_32 with seed 0.
fn murmur3(bytes: &[u8]) -> u32 {
    let scrambled = |word: u32| word.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let words = bytes.chunks_exact(4);
    let mut tail = [0; 4];
    tail[..words.remainder().len()].copy_from_slice(words.remainder());
    let mut h = 0u32;
    for word in words {
        h ^= scrambled(u32::from_le_bytes(word.try_into().expect("four bytes")));
        h = h.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    h ^= scrambled(u32::from_le_bytes(tail));
    h ^= bytes.len() as u32;
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// Bits of the float that stands for `name`: finite, normal, never 0.
pub fn id_of(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    match hash >> 23 & 0xff {
        0 | 0xff => hash ^ 1 << 23,
        _ => hash,
    }
}

/// What a pixel's list is in a file: id and coverage, rank by rank.
pub(super) fn values(ids: &Ids) -> [f32; 2 * LEVELS] {
    let mut values = [0.0; 2 * LEVELS];
    for (pair, (id, coverage)) in values.chunks_exact_mut(2).zip(ids.ranked()) {
        pair.copy_from_slice(&[f32::from_bits(id), coverage as f32]);
    }
    values
}

/// Channels of layer `layer` with their places in what [`values`] gives.
pub(super) fn channels(layer: &str) -> Vec<(String, usize)> {
    (0..2 * LEVELS)
        .map(|value| (format!("{layer}{:02}.{}", value / 4, ["R", "G", "B", "A"][value % 4]), value))
        .collect()
}

/// What a file says of a layer of ids.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matte {
    /// The layer's name.
    pub layer: String,
    /// Its names and their ids, as JSON.
    pub manifest: String,
}

impl Matte {
    /// Of layer `layer`, whose ids are of `names`.
    pub fn new<'n>(layer: &str, names: impl Iterator<Item = &'n str>) -> Matte {
        let ids: BTreeMap<&str, String> = names.map(|name| (name, format!("{:08x}", id_of(name)))).collect();
        let manifest = serde_json::to_string(&ids).expect("a map of strings is valid JSON");
        Matte { layer: layer.into(), manifest }
    }

    /// The attributes where the layer is called `name`: names and texts.
    pub(super) fn attributes<'m>(&'m self, name: &'m str) -> [(String, &'m str); 4] {
        let key = &format!("{:08x}", murmur3(name.as_bytes()))[..KEY_DIGITS];
        let texts = [
            ("name", name),
            ("hash", "MurmurHash3_32"),
            ("conversion", "uint32_to_float32"),
            ("manifest", self.manifest.as_str()),
        ];
        texts.map(|(name, text)| (format!("cryptomatte/{key}/{name}"), text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the specification's vectors, and its reference code in Python for those whose exponent is changed.
    #[test]
    fn names_have_the_ids_of_the_specification() {
        for (name, id) in [
            ("bunny", 0x1385_1a76),
            ("default", 0x42c9_679f),
            ("bunny_porcelain_mat", 0xb24b_26d4),
            ("torus", 0xf19c_73fd),
            ("равнина", 0x9623_511e),
            ("CryptoObject", 0x3ae3_9a58),
            ("CryptoMaterial", 0xbe35_9d67),
            ("CryptoAsset", 0xf420_29dd),
            ("ViewLayer.CryptoObject", 0x542c_afaf),
            ("obj45", 0x00f3_4d5c),
            ("obj520", 0x7f3b_01ed),
            ("obj522", 0x808a_20bd),
            ("", 0x0080_0000),
        ] {
            assert_eq!(id_of(name), id, "{name}: {:08x}", id_of(name));
            assert!(f32::from_bits(id).is_normal(), "{name}");
        }
        assert_eq!([murmur3(b"obj45"), murmur3(b"obj520"), murmur3(b"")], [0x0073_4d5c, 0x7fbb_01ed, 0]);
        assert_eq!(f32::from_bits(id_of("torus")), -1.549_436_2e30);
    }

    /// Oracle: the specification.
    #[test]
    fn attributes_give_the_names_back() {
        let matte = Matte::new("crypto_object", ["b \"x\"", "bunny", "bunny"].into_iter());
        let [name, hash, conversion, manifest] = matte.attributes("CryptoObject");
        assert_eq!(name, ("cryptomatte/3ae39a5/name".into(), "CryptoObject"));
        assert_eq!(hash, ("cryptomatte/3ae39a5/hash".into(), "MurmurHash3_32"));
        assert_eq!(conversion, ("cryptomatte/3ae39a5/conversion".into(), "uint32_to_float32"));
        assert_eq!(manifest.0, "cryptomatte/3ae39a5/manifest");
        assert_eq!(manifest.1, format!(r#"{{"b \"x\"":"{:08x}","bunny":"13851a76"}}"#, id_of("b \"x\"")));
        assert!(conversion.0.len() <= 31);
    }

    /// Oracle: by hand. Six ranks of seven; ids keep their bits.
    #[test]
    fn six_ids_are_written() {
        let mut ids = Ids::default();
        let all: Vec<u32> = (0..7).map(|i| id_of(&format!("obj{i}"))).collect();
        for (i, &id) in all.iter().enumerate() {
            ids.add(id, 10 - i as i64);
        }
        let values = values(&ids);
        for (rank, id) in all.iter().enumerate().take(LEVELS) {
            assert_eq!(values[2 * rank].to_bits(), *id);
            assert_eq!(values[2 * rank + 1], (10 - rank) as f32 / 49.0);
        }
        let names: Vec<String> = channels("x").into_iter().map(|(name, _)| name).collect();
        assert_eq!(names[..5], ["x00.R", "x00.G", "x00.B", "x00.A", "x01.R"]);
        assert_eq!((names.len(), names[11].as_str()), (12, "x02.A"));
    }
}
