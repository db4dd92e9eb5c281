//! Why a description cannot be built.

/// What is wrong with a [`Description`](crate::Description).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A triangle, or a list of indices of a mesh.
    #[error("mesh \"{mesh}\", triangle {triangle}: {what}")]
    Triangle {
        /// Name of the mesh.
        mesh: String,
        /// Index of the triangle in it.
        triangle: usize,
        /// What is wrong.
        what: String,
    },
    /// A vertex of a mesh.
    #[error("mesh \"{mesh}\", {kind} {index}: {what}")]
    Vertex {
        /// Name of the mesh.
        mesh: String,
        /// `position`, `normal` or `texture coordinate`.
        kind: &'static str,
        /// Index in its list.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// A mesh as a whole.
    #[error("mesh \"{mesh}\": {what}")]
    Mesh {
        /// Name of the mesh.
        mesh: String,
        /// What is wrong.
        what: &'static str,
    },
    /// A material.
    #[error("material \"{material}\" ({index}): {what}")]
    Material {
        /// Name of the material.
        material: String,
        /// Its index.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// A free form.
    #[error("free form \"{form}\" ({index}): {what}")]
    Form {
        /// Name of the free form.
        form: String,
        /// Its index.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// A texture.
    #[error("texture {index}: {what}")]
    Texture {
        /// Its index.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// A point or directional light.
    #[error("light {index}: {what}")]
    Light {
        /// Its index.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// All lights together: triangles and free forms that shine, the surroundings and the others.
    #[error("lights: {0}")]
    Lights(&'static str),
    /// The surroundings.
    #[error("environment, pixel {pixel}: {what}")]
    Environment {
        /// Index of the pixel, row by row.
        pixel: usize,
        /// What is wrong.
        what: &'static str,
    },
    /// The camera.
    #[error("camera: {0}")]
    Camera(&'static str),
    /// More than can be numbered.
    #[error("{count} {what}: at most {limit} are possible")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
}
