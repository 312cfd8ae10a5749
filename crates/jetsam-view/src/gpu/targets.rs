//! The pictures between the passes. Made anew when the size changes.

/// Edge of the sun's map of water.
pub const VEIL: u32 = 512;

pub const ALBEDO: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
pub const NORMAL: wgpu::TextureFormat = wgpu::TextureFormat::Rgb10a2Unorm;
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
pub const LIGHT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
pub const FIELD: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;
pub const WATER: wgpu::TextureFormat = wgpu::TextureFormat::R16Float;

/// Pictures of one size.
pub struct Targets {
    pub size: [u32; 2],
    pub albedo: wgpu::TextureView,
    pub normal: wgpu::TextureView,
    pub depth: wgpu::TextureView,
    /// What is lit, without water.
    pub scene: wgpu::TextureView,
    pub fluid_depth: wgpu::TextureView,
    /// Depth of the fluid's surface (m), to and fro between passes of smoothing.
    pub field: [wgpu::TextureView; 2],
    /// Water along lines of sight (m), at half the size.
    pub thickness: wgpu::TextureView,
    /// With water.
    pub whole: wgpu::TextureView,
}

/// A picture that is drawn to and read.
pub fn texture(device: &wgpu::Device, label: &str, size: [u32; 2], format: wgpu::TextureFormat) -> wgpu::TextureView {
    let extent = wgpu::Extent3d { width: size[0].max(1), height: size[1].max(1), depth_or_array_layers: 1 };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: extent,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

impl Targets {
    pub fn new(device: &wgpu::Device, size: [u32; 2]) -> Self {
        let make = |label, size, format| texture(device, label, size, format);
        let half = size.map(|s| s.div_ceil(2));
        Self {
            size,
            albedo: make("albedo", size, ALBEDO),
            normal: make("normal", size, NORMAL),
            depth: make("depth", size, DEPTH),
            scene: make("scene", size, LIGHT),
            fluid_depth: make("fluid depth", size, DEPTH),
            field: [make("field", size, FIELD), make("field", size, FIELD)],
            thickness: make("thickness", half, WATER),
            whole: make("whole", size, LIGHT),
        }
    }
}
