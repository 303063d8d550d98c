//! The integration tests, one module a theme.

mod loading;
mod textures;
