//! What a material can do, in one place. Everything that distinguishes materials (kernels, plan, tables, loader, ledger
//! of biases) asks these facts, so that all of them draw the same lines.
//!
//! A fact is true if *some* hit on the material can be so. Textures multiply factors and lie in [0, 1]: a factor of 0
//! stays 0, any other may become anything from 0 to itself.

use glam::Vec3;

use super::alpha::AlphaMode;
use super::parameters::{Material, TextureSlot};
use crate::texture::Texture;

/// glTF roughness below which a microfacet lobe is a mirror.
pub const MIRROR_ROUGHNESS: f32 = 0.01;

/// GGX alpha up to which a lobe bundles light so that light paths are aimed at it.
pub const BUNDLING_ALPHA: f32 = 0.2;

/// Something that a material can do or needs. The first are what a hit can turn out to be ([`Fact::MODELS`]): of a
/// partly transmissive material one is drawn per hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Fact {
    /// Scatters nothing and is not unlit: an emitter with base colour 0, or a black body.
    Black = 0,
    /// Shows its base colour; neither scatters nor emits.
    Unlit,
    /// Exactly diffuse.
    Lambert,
    /// Opaque with a specular lobe: a metal, a coat over a diffuse base, or a mixture of both.
    Glossy,
    /// Dielectric with an inside.
    Solid,
    /// Transmits through a thin wall.
    Thin,
    /// Any of these but unlit, under a clearcoat.
    Clearcoat,
    /// The same under fibres.
    Sheen,
    /// Opaque, with a base that lets light pass.
    Translucent,

    /// Emits light of its front side: an area light.
    Emits,
    /// Metal, at least in part.
    Metal,
    /// Metal everywhere, whatever the textures say.
    MetalOnly,
    /// Opaque dielectric, at least in part: a diffuse base with or without a coat.
    Base,
    /// Dielectric coat over a diffuse base: needs the albedo tables.
    Coat,
    /// Only bounds the inside of a solid: light that is neither reflected nor bent goes straight on, everywhere times
    /// the same colour.
    Clear,
    /// Absorbs light inside a solid.
    Absorbs,
    /// Scatters light inside a solid.
    Scatters,
    /// A specular lobe that may be too smooth for densities.
    Mirror,
    /// A specular lobe that may be rough.
    Rough,

    /// A specular lobe that may be smooth enough to bundle light.
    Casts,

    /// Reads a texture.
    Textures,
    /// Multiplies by vertex colours, where the mesh has them.
    VertexColors,
    /// Is not there everywhere: alpha masks and blending. See [`Facts::alpha`].
    Uncovered,
    /// Specular lobes have a grain.
    Grain,
    /// Specular lobes are under a thin film.
    Film,
    /// A solid whose index depends on the wavelength.
    Disperses,
    /// Has layers, lobes or textures of extensions that change how it scatters: the kernel of layers shades it.
    Layers,
}

/// A set of facts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FactSet(u32);

/// What a material can do.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Facts {
    /// What is true of it.
    pub set: FactSet,
    /// The most that it can reflect or transmit of light from any direction, by channel: the base colour of an exact
    /// Lambert surface (textures only lower it), 1 with a specular lobe, 0 where it is unlit.
    pub reflectance_bound: Vec3,
    /// The alpha mode as far as it matters: opaque where no alpha that factor, texture and vertex colours can make lets
    /// a ray pass.
    pub alpha: AlphaMode,
}

impl Facts {
    /// Of a material whose textures may hold anything.
    pub fn of(material: &Material) -> Facts {
        let alpha = alpha(material, material.base_color_texture.is_some());
        let mut set = FactSet::default();
        set.put(Fact::Textures, material.reads_textures());
        set.put(Fact::VertexColors, material.vertex_colors);
        set.put(Fact::Uncovered, alpha != AlphaMode::Opaque);
        set.put(Fact::Emits, material.is_emissive());
        if material.unlit {
            set.put(Fact::Unlit, true);
            return Facts { set, reflectance_bound: Vec3::ZERO, alpha };
        }

        // Parts of the mixture.
        let varies = material.metallic_roughness_texture.is_some();
        let gloss_varies = material.glossiness_texture.is_some();
        let metal = material.metallic > 0.0;
        let metal_only = material.metallic >= 1.0 && !varies;
        let transmits = material.transmission > 0.0 && !metal_only;
        let base = (material.transmission < 1.0 || material.transmission_texture.is_some()) && !metal_only;
        let coat = base && material.specular > 0.0;
        set.put(Fact::Metal, metal);
        set.put(Fact::MetalOnly, metal_only);
        set.put(Fact::Base, base);
        set.put(Fact::Coat, coat);

        // What a hit turns out to be. Without a coat, metal and diffuse base are one lobe unless one of them can be
        // absent.
        let solid = transmits && material.thickness > 0.0;
        let diffuse = base && !coat && (!metal || varies || transmits);
        let black = material.base_color == Vec3::ZERO;
        set.put(Fact::Black, diffuse && black);
        set.put(Fact::Lambert, diffuse && !black);
        set.put(Fact::Glossy, metal || coat);
        set.put(Fact::Solid, solid);
        set.put(Fact::Thin, transmits && !solid);

        let attenuates = material.attenuation_distance_m.is_finite() && material.attenuation_color != Vec3::ONE;
        set.put(Fact::Absorbs, solid && attenuates);
        set.put(Fact::Scatters, solid && attenuates && material.multiscatter_color != Vec3::ZERO);
        let clearcoat = material.clearcoat > 0.0;
        set.put(Fact::Clearcoat, clearcoat);
        let sheen = material.has_sheen();
        set.put(Fact::Sheen, sheen);
        let (grain, film) = (material.anisotropy > 0.0, material.iridescence > 0.0);
        let translucent = base && material.diffuse_transmission > 0.0;
        set.put(Fact::Grain, grain);
        set.put(Fact::Film, film);
        set.put(Fact::Translucent, translucent);
        let disperses = solid && material.disperses();
        set.put(Fact::Disperses, disperses);
        let lobes = disperses || clearcoat || sheen || grain || film || translucent;
        set.put(Fact::Layers, lobes || material.reads_extension_textures());
        let specular = metal || coat || transmits || clearcoat || sheen || translucent;
        let smooth = |roughness: f32| roughness < MIRROR_ROUGHNESS;
        let (body, layer) = (metal || coat || transmits, material.clearcoat_roughness);
        let layer_varies = material.clearcoat_roughness_texture.is_some();
        let smooth_body = body && (varies || smooth(material.roughness));
        set.put(Fact::Mirror, smooth_body || clearcoat && (layer_varies || smooth(layer)));
        set.put(
            Fact::Rough,
            body && (gloss_varies || !smooth(material.roughness))
                || clearcoat && !smooth(layer)
                || sheen
                || body && grain,
        );
        set.put(Fact::Casts, casts(material, set, |_, _| [0.0, 1.0]));
        let even = material.base_color_texture.is_none() && !material.vertex_colors && !set.has(Fact::Layers);
        set.put(Fact::Clear, set.models() == FactSet::of(&[Fact::Solid]) && even);
        let reflectance_bound = if specular { Vec3::ONE } else { material.base_color.clamp(Vec3::ZERO, Vec3::ONE) };
        Facts { set, reflectance_bound, alpha }
    }

    /// As [`of`](Self::of), of a material of a scene with these textures: one whose texture has no alpha below 1 is
    /// known to be opaque, and one whose texture is rough everywhere bundles no light.
    pub fn with_textures(material: &Material, textures: &[Texture]) -> Facts {
        let alpha = material.effective_alpha(textures);
        let mut facts = Facts { alpha, ..Facts::of(material) };
        facts.set.put(Fact::Uncovered, alpha != AlphaMode::Opaque);
        let range = |slot: TextureSlot, channel| {
            textures.get(slot.texture.index()).map_or([0.0, 1.0], |texture| texture.texels.range(channel))
        };
        facts.set.put(Fact::Casts, casts(material, facts.set, range));
        facts
    }

    /// Whether a fact is true of it.
    #[inline(always)]
    pub fn has(&self, fact: Fact) -> bool {
        self.set.has(fact)
    }

    /// Whether it transmits light.
    #[inline(always)]
    pub fn transmits(&self) -> bool {
        self.has(Fact::Solid) || self.has(Fact::Thin) || self.has(Fact::Translucent)
    }

    /// Whether it is diffuse or black at every hit, whatever its textures say.
    #[inline(always)]
    pub fn is_diffuse(&self) -> bool {
        self.set.models().is_subset(FactSet::of(&[Fact::Black, Fact::Lambert]))
    }

    /// Whether light that its facets scatter more than once is lost: single scattering off rough metals and glass.
    #[inline(always)]
    pub fn loses(&self) -> bool {
        self.has(Fact::Rough) && (self.has(Fact::Metal) || self.has(Fact::Solid) || self.has(Fact::Thin))
    }

    /// Whether a layer shares light with what is below it, by the tables of directional albedo.
    #[inline(always)]
    pub fn is_layered(&self) -> bool {
        self.has(Fact::Coat) || self.has(Fact::Clearcoat)
    }

    /// Whether neither textures nor vertex colours change its factors.
    #[inline(always)]
    pub fn is_plain(&self) -> bool {
        !self.has(Fact::Textures) && !self.has(Fact::VertexColors)
    }
}

/// Whether a specular lobe can be as smooth as [`BUNDLING_ALPHA`]; `set` has what it can turn out to be, and `range`
/// tells the least and the largest value of a texture's channel.
fn casts(material: &Material, set: FactSet, range: impl Fn(TextureSlot, usize) -> [f32; 2]) -> bool {
    let bundles = |roughness: f32| roughness * roughness <= BUNDLING_ALPHA;
    let of = |slot: Option<TextureSlot>, channel| slot.map_or([1.0; 2], |slot| range(slot, channel));
    let body = || {
        let roughness = material.roughness * of(material.metallic_roughness_texture, 1)[0];
        let glossiness = of(material.glossiness_texture, 3)[1];
        bundles(if glossiness < 1.0 { 1.0 - (1.0 - roughness) * glossiness } else { roughness })
    };
    let layer = || bundles(material.clearcoat_roughness * of(material.clearcoat_roughness_texture, 1)[0]);
    let models = FactSet::of(&[Fact::Metal, Fact::Coat, Fact::Solid, Fact::Thin]);
    set.0 & models.0 != 0 && body() || set.has(Fact::Clearcoat) && layer()
}

/// The alpha mode as far as it matters; `textured` if a texture can have alpha below 1.
fn alpha(material: &Material, textured: bool) -> AlphaMode {
    let mode = material.alpha_mode;
    let covers = mode.coverage(material.base_alpha) >= 1.0;
    let varies = textured || material.vertex_colors;
    if covers && (!varies || mode.coverage(0.0) >= 1.0) { AlphaMode::Opaque } else { mode }
}

impl Fact {
    /// What a hit can turn out to be, in the order in which plans list it.
    pub const MODELS: [Fact; 9] = [
        Fact::Black,
        Fact::Unlit,
        Fact::Lambert,
        Fact::Glossy,
        Fact::Solid,
        Fact::Thin,
        Fact::Clearcoat,
        Fact::Sheen,
        Fact::Translucent,
    ];

    /// Spelling in plans and statistics.
    pub fn name(self) -> &'static str {
        match self {
            Fact::Black => "black",
            Fact::Unlit => "unlit",
            Fact::Lambert => "lambert",
            Fact::Glossy => "glossy",
            Fact::Solid => "dielectric",
            Fact::Thin => "thin",
            Fact::Clearcoat => "clearcoat",
            Fact::Sheen => "sheen",
            Fact::Translucent => "diffuse-transmission",
            Fact::Grain => "anisotropy",
            Fact::Film => "iridescence",
            Fact::Disperses => "dispersion",
            Fact::Emits => "emits",
            Fact::Metal => "metal",
            Fact::MetalOnly => "metal-only",
            Fact::Base => "opaque-dielectric",
            Fact::Coat => "dielectric-coat",
            Fact::Clear => "clear",
            Fact::Absorbs => "absorption",
            Fact::Scatters => "scattering",
            Fact::Mirror => "mirror",
            Fact::Rough => "rough",
            Fact::Casts => "casts-light",
            Fact::Textures => "textures",
            Fact::VertexColors => "vertex-colours",
            Fact::Uncovered => "alpha",
            Fact::Layers => "layers",
        }
    }
}

impl FactSet {
    /// The set of `facts`.
    pub const fn of(facts: &[Fact]) -> Self {
        let (mut bits, mut i) = (0, 0);
        while i < facts.len() {
            bits |= 1 << facts[i] as u32;
            i += 1;
        }
        FactSet(bits)
    }

    fn put(&mut self, fact: Fact, is: bool) {
        self.0 = self.0 & !(1 << fact as u32) | u32::from(is) << fact as u32;
    }

    /// Whether `fact` is in it.
    #[inline(always)]
    pub fn has(self, fact: Fact) -> bool {
        self.0 & (1 << fact as u32) != 0
    }

    /// Whether `others` hold all of it.
    #[inline(always)]
    pub fn is_subset(self, others: Self) -> bool {
        self.0 & !others.0 == 0
    }

    /// Both sets together.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        FactSet(self.0 | other.0)
    }

    /// Those that say what a hit can turn out to be.
    #[inline(always)]
    #[must_use]
    pub fn models(self) -> Self {
        FactSet(self.0 & FactSet::of(&Fact::MODELS).0)
    }
}

impl Material {
    /// The most that the surface can reflect; see [`Facts::reflectance_bound`].
    pub fn reflectance_bound(&self) -> Vec3 {
        Facts::of(self).reflectance_bound
    }

    /// Whether light of different wavelengths goes different ways: solids alone do that, of a finite index.
    #[inline(always)]
    pub fn disperses(&self) -> bool {
        self.dispersion > 0.0 && self.thickness > 0.0 && self.transmission > 0.0 && self.ior >= 1.0
    }

    /// Whether there is sheen: fibres of some colour, rough enough to reflect but at the horizon.
    pub fn has_sheen(&self) -> bool {
        self.sheen_color.max_element() > 0.0 && self.sheen_roughness >= MIRROR_ROUGHNESS
    }

    /// Whether the back may be hidden: glTF's `doubleSided` is false, and no inside has the surface as its boundary.
    #[inline(always)]
    pub fn is_one_sided(&self) -> bool {
        let bounds_inside = self.transmission > 0.0 && self.thickness > 0.0;
        !self.double_sided && !bounds_inside
    }

    /// Whether a mesh may be shared with `other`: both are opaque surfaces without light, without an inside and that
    /// need no tangents, and read the same attributes of vertices.
    pub fn may_share(&self, other: &Material) -> bool {
        let is_plain = |material: &Material| {
            let facts = Facts::of(material);
            !material.is_emissive()
                && !facts.transmits()
                && material.alpha_mode == AlphaMode::Opaque
                && material.tangent_channel().is_none()
        };
        is_plain(self)
            && is_plain(other)
            && self.vertex_colors == other.vertex_colors
            && self.reads_textures() == other.reads_textures()
            && self.uv_channels() == other.uv_channels()
    }

    /// Whether the surface emits light: an area light.
    #[inline(always)]
    pub fn is_emissive(&self) -> bool {
        !self.unlit && self.emissive.max_element() > 0.0
    }

    /// The alpha mode as far as it matters; see [`Facts::alpha`].
    pub fn effective_alpha(&self, textures: &[Texture]) -> AlphaMode {
        let texture = self.base_color_texture.and_then(|slot| textures.get(slot.texture.index()));
        alpha(self, texture.is_some_and(|texture| texture.texels.may_have_alpha()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: glTF 2.0 §3.9.4 by hand.
    #[test]
    fn modes_that_let_nothing_pass_are_opaque() {
        let material = |alpha_mode, base_alpha| Material { alpha_mode, base_alpha, ..Material::default() };
        let mask = |cutoff| AlphaMode::Mask { cutoff };
        for (mode, alpha, expected) in [
            (AlphaMode::Opaque, 0.2, AlphaMode::Opaque),
            (AlphaMode::Blend, 1.0, AlphaMode::Opaque),
            (AlphaMode::Blend, 0.999, AlphaMode::Blend),
            (mask(0.5), 0.5, AlphaMode::Opaque),
            (mask(0.5), 0.4, mask(0.5)),
            (mask(0.0), 0.0, AlphaMode::Opaque),
            (mask(1.5), 1.0, mask(1.5)),
        ] {
            let facts = Facts::of(&material(mode, alpha));
            assert_eq!(facts.alpha, expected, "{mode:?} {alpha}");
            assert_eq!(facts.has(Fact::Uncovered), expected != AlphaMode::Opaque);
        }
        let colored = Material { vertex_colors: true, ..material(AlphaMode::Blend, 1.0) };
        assert_eq!(colored.effective_alpha(&[]), AlphaMode::Blend);
    }

    /// Oracle: the mixture of KHR_materials_transmission by hand, what a hit can turn out to be.
    #[test]
    fn models_of_mixtures() {
        use super::super::super::ids::TextureId;
        let plain = Material { metallic: 0.0, specular: 0.0, ..Material::default() };
        let texture = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
        let cases: [(Material, &[Fact]); 8] = [
            (plain.clone(), &[Fact::Lambert]),
            (Material { base_color: Vec3::ZERO, ..plain.clone() }, &[Fact::Black]),
            (Material { unlit: true, ..plain.clone() }, &[Fact::Unlit]),
            (Material::default(), &[Fact::Glossy]),
            (Material { metallic: 0.5, ..plain.clone() }, &[Fact::Glossy]),
            (Material { transmission: 1.0, thickness: 1.0, ..plain.clone() }, &[Fact::Solid]),
            (
                Material { metallic: 0.5, transmission: 0.5, ..plain.clone() },
                &[Fact::Lambert, Fact::Glossy, Fact::Thin],
            ),
            (
                Material { metallic: 1.0, transmission: 1.0, metallic_roughness_texture: texture, ..plain.clone() },
                &[Fact::Glossy, Fact::Thin],
            ),
        ];
        for (material, models) in cases {
            assert_eq!(Facts::of(&material).set.models(), FactSet::of(models), "{material:?}");
        }
        assert!(Facts::of(&plain).is_diffuse() && !Facts::of(&Material::default()).is_diffuse());
    }

    /// Textures that make a rough factor smooth, and glossy ones that dull a smooth one. Oracle: by hand.
    #[test]
    fn what_bundles_light_is_known_by_the_smoothest_texel() {
        use super::super::super::ids::TextureId;
        use crate::texture::{ColorSpace, Wrap};
        let of = |bytes: [[u8; 4]; 2]| Texture {
            name: String::new(),
            width: 2,
            height: 1,
            texels: bytes.to_vec().into(),
            color_space: ColorSpace::Linear,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            bilinear: true,
        };
        let (rough, partly) = ([255, 200, 255, 255], [255, 50, 255, 255]);
        let textures = [of([rough, rough]), of([rough, partly]), of([[255, 255, 255, 50]; 2])];
        let slot = |number| Some(TextureSlot { texture: TextureId(number), uv_set: 0 });
        let textured = |number| Material { metallic_roughness_texture: slot(number), ..Material::default() };
        let casts = |material: &Material| Facts::with_textures(material, &textures).has(Fact::Casts);
        assert!(!casts(&Material::default()) && casts(&Material { roughness: 0.4, ..Material::default() }));
        assert!(!casts(&textured(0)) && casts(&textured(1)) && Facts::of(&textured(0)).has(Fact::Casts));
        assert!(!casts(&Material { specular: 0.0, metallic: 0.0, ..textured(1) }), "no lobe");
        let glossy = Material { roughness: 0.0, glossiness_texture: slot(2), ..Material::default() };
        assert!(!casts(&glossy) && casts(&Material { glossiness_texture: slot(0), ..glossy.clone() }));
        let coated = Material { clearcoat: 1.0, clearcoat_roughness: 1.0, ..Material::default() };
        assert!(!casts(&coated) && casts(&Material { clearcoat_roughness_texture: slot(1), ..coated.clone() }));
    }
}
