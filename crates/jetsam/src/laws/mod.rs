//! The laws, each once: pure functions of a pair's or a particle's own numbers, without loops or buffers.
//!
//! They are WGSL text, so that a GPU backend can run the very same lines; at compile time the text becomes
//! Rust functions of the same name. The numbers E1.. are those of `docs/physics.md`.
//!
//! # Who acts on whom
//!
//! | i \ j | fluid | rigid | static |
//! |---|---|---|---|
//! | fluid | E1, E4, E5, E6 | E1, E17 (or E16) | E1, E17 |
//! | rigid | E17 (or E16) | E10-E12, other bodies only | E10-E12 |
//! | static | E17 | E10-E12 | - |
//!
//! Every pair is evaluated from both of its ends with the same operands, so that what `i` gets, `j` loses to
//! the last bit. Laws of bodies as a whole (E18-E21) are in [`crate::integrate`].

pub mod kernel;

macro_rules! law_file {
    ($(#[$doc:meta])* $name:ident, $path:literal) => {
        $(#[$doc])*
        #[allow(missing_docs, dead_code, non_snake_case, unused_imports, clippy::all)] // translated text
        pub mod $name {
            use super::Root as _;
            naga_rust_embed::include_wgsl_mr!(public_items = true, rule(inline(always)), $path);
        }
    };
}

/// Square root for the scalars of translated WGSL, whose runtime lacks it.
trait Root {
    fn sqrt(self) -> Self;
}

impl Root for naga_rust_embed::rt::Scalar<f32> {
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
}

law_file!(
    /// E2, the kernels' shapes (`laws/kernel.wgsl`); [`kernel::Kernel`] gives them their norms.
    shape,
    "src/laws/kernel.wgsl"
);
law_file!(
    /// E3-E6 and the boundary pressure of E17 (`laws/fluid.wgsl`).
    fluid,
    "src/laws/fluid.wgsl"
);
law_file!(
    /// E9, implicit pressure (`laws/implicit.wgsl`).
    implicit,
    "src/laws/implicit.wgsl"
);
law_file!(
    /// E10-E12 and E14, contact of bodies (`laws/contact.wgsl`).
    contact,
    "src/laws/contact.wgsl"
);
law_file!(
    /// E30, fields (`laws/field.wgsl`).
    field,
    "src/laws/field.wgsl"
);
law_file!(
    /// E22-E24, E26, E27, flocks (`laws/flock.wgsl`).
    flock,
    "src/laws/flock.wgsl"
);
