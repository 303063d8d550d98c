//! What the channels of a file are called: as this program calls them, or as compositors that are set up for other
//! renderers expect. Names alone differ; axes, units and where nothing is met are as GUIDE.md says.
//!
//! * `blender`: those of multilayer files of Blender 2.8 to 4.5 with the view layer `ViewLayer`, so that the beauty is
//!   `ViewLayer.Combined`. Layers that Blender does not have keep their names behind that of the view layer. Source:
//!   the names of passes in Blender's `DNA_scene_enums.h` and of Cycles' `sync.cpp`.
//!   Its `Vector` holds the ways from the last frame and to the next, which the shutter does not tell: `motion` stays.
//! * `nuke`: a layer's channels are `red`, `green`, `blue`, `alpha` in turn, as Nuke's own nodes expect and write them;
//!   depth is `depth.Z`, motion `forward.u`, `forward.v`, which VectorBlur reads; the beauty stays R, G, B, A, which is
//!   Nuke's `rgba`. Source: Nuke's user guide, "Channels", "VectorBlur".

use std::str::FromStr;

/// A naming of channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PassNames {
    /// As GUIDE.md lists them.
    #[default]
    Own,
    /// As Blender writes them.
    Blender,
    /// As Nuke expects them.
    Nuke,
}

/// Layers here (the beauty has no name) and in Blender.
const BLENDER: [(&str, &str); 12] = [
    ("", "Combined"),
    ("Z", "Depth"),
    ("N", "Normal"),
    ("P", "Position"),
    ("UV", "UV"),
    ("emission", "Emit"),
    ("background", "Env"),
    ("albedo", "Denoising Albedo"),
    ("spp", "Debug Sample Count"),
    ("crypto_object", "CryptoObject"),
    ("crypto_material", "CryptoMaterial"),
    ("crypto_asset", "CryptoAsset"),
];

/// Components of a layer in Nuke.
const NUKE: [&str; 4] = ["red", "green", "blue", "alpha"];

impl PassNames {
    /// Those of the command line, in the order of the help text.
    pub const ALL: [PassNames; 2] = [PassNames::Blender, PassNames::Nuke];

    /// Spelling on the command line.
    pub fn name(self) -> &'static str {
        match self {
            PassNames::Own => "own",
            PassNames::Blender => "blender",
            PassNames::Nuke => "nuke",
        }
    }

    /// What layer `own` is called, or one that numbers its files (`crypto_object00`).
    pub fn layer(self, own: &str) -> String {
        match self {
            PassNames::Own => own.into(),
            PassNames::Nuke => match own {
                "Z" => "depth".into(),
                "motion" => "forward".into(),
                _ => own.into(),
            },
            PassNames::Blender => {
                let numbered = |(ours, theirs): (&str, &str)| {
                    let number = own.strip_prefix(ours)?;
                    number.bytes().all(|byte| byte.is_ascii_digit()).then(|| format!("{theirs}{number}"))
                };
                let theirs = BLENDER.into_iter().find_map(numbered).unwrap_or_else(|| own.into());
                format!("ViewLayer.{theirs}")
            }
        }
    }

    /// What channels are called; those of a layer follow each other.
    pub fn channels<'n>(self, own: impl IntoIterator<Item = &'n str>) -> Vec<String> {
        let (mut last, mut place) = ("", 0);
        let name = |own: &'n str| {
            // Depth has no component, the beauty no layer.
            let (layer, component) = own.rsplit_once('.').unwrap_or(if own == "Z" { (own, own) } else { ("", own) });
            place = if layer == last { place + 1 } else { 0 };
            last = layer;
            match (self, layer) {
                (PassNames::Own, _) | (PassNames::Nuke, "") => own.into(),
                (PassNames::Nuke, "motion") => format!("{}.{}", self.layer(layer), ["u", "v"][place]),
                (PassNames::Nuke, "Z") => format!("{}.Z", self.layer(layer)),
                (PassNames::Nuke, _) => format!("{}.{}", self.layer(layer), NUKE.get(place).unwrap_or(&component)),
                (PassNames::Blender, "spp") => format!("{}.X", self.layer(layer)),
                (PassNames::Blender, _) if layer.starts_with("crypto_") => {
                    format!("{}.{}", self.layer(layer), component.to_lowercase())
                }
                (PassNames::Blender, _) => format!("{}.{component}", self.layer(layer)),
            }
        };
        own.into_iter().map(name).collect()
    }
}

impl FromStr for PassNames {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let named = PassNames::ALL.into_iter().find(|names| names.name() == s);
        named.ok_or_else(|| format!("'{s}' is not one of blender, nuke"))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::film::layer::LAYERS;
    use crate::film::layer::beauty::CHANNELS;
    use crate::film::layer::kind::Shape;

    /// Oracle: written by hand.
    #[test]
    fn channels_are_called_as_elsewhere() {
        let own =
            ["R", "A", "Z", "N.X", "N.Z", "UV.U", "spp.Y", "albedo.G", "direct.B", "crypto_asset02.A", "motion.Y"];
        let blender = [
            "ViewLayer.Combined.R",
            "ViewLayer.Combined.A",
            "ViewLayer.Depth.Z",
            "ViewLayer.Normal.X",
            "ViewLayer.Normal.Z",
            "ViewLayer.UV.U",
            "ViewLayer.Debug Sample Count.X",
            "ViewLayer.Denoising Albedo.G",
            "ViewLayer.direct.B",
            "ViewLayer.CryptoAsset02.a",
            "ViewLayer.motion.Y",
        ];
        assert_eq!(PassNames::Own.channels(own), own);
        assert_eq!(PassNames::Blender.channels(own), blender);
        let own = ["R", "G", "B", "A", "Z", "N.X", "N.Y", "N.Z", "UV.U", "UV.V", "spp.Y", "albedo.R", "bounce_00.R"];
        let nuke = [
            "R",
            "G",
            "B",
            "A",
            "depth.Z",
            "N.red",
            "N.green",
            "N.blue",
            "UV.red",
            "UV.green",
            "spp.red",
            "albedo.red",
            "bounce_00.red",
        ];
        assert_eq!(PassNames::Nuke.channels(own), nuke);
        assert_eq!(PassNames::Nuke.channels(["motion.X", "motion.Y"]), ["forward.u", "forward.v"]);
        assert_eq!(PassNames::Nuke.channels(["crypto_asset02.R", "crypto_asset02.G"])[1], "crypto_asset02.green");
        assert_eq!(PassNames::Blender.layer("crypto_object"), "ViewLayer.CryptoObject");
        assert_eq!(PassNames::Blender.layer("Ng"), "ViewLayer.Ng");
    }

    /// No two channels get one name.
    #[test]
    fn channels_stay_apart() {
        let shape = Shape { max_depth: 64, groups: &["key".into()] };
        let own: Vec<String> = CHANNELS
            .map(String::from)
            .into_iter()
            .chain(LAYERS.iter().flat_map(|layer| (layer.channels)(&shape)).map(|(name, _)| name))
            .collect();
        for names in PassNames::ALL {
            let named: BTreeSet<String> = names.channels(own.iter().map(String::as_str)).into_iter().collect();
            assert_eq!(named.len(), own.len(), "{}", names.name());
            assert_eq!(names.name().parse(), Ok(names));
        }
    }
}
