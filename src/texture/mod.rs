//! temporary
/// stub
pub fn lookup(_t: &crate::scene::Texture, _uv: glam::Vec2) -> glam::Vec4 {
    glam::Vec4::ONE
}
