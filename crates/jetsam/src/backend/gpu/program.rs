//! The kernels of a scene: its choices as constants, the laws, the twins of the stages, in one WGSL text.
//!
//! In: a [`Model`]. Out: the text, and pipelines whose bindings are read off it: a kernel is bound to the buffers it uses and to
//! no other, as devices allow few.

use super::GpuError;
use super::layout::BEYOND;
use crate::gpu::Gpu;
use crate::integrate::sleep;
use crate::integrate::sources::Bore;
use crate::interact::contacts::{DEEP, HELD};
use crate::interact::pairs::SHIFTED_ABOVE;
use crate::interact::pressure::BELOW_SUM;
use crate::interact::{coarse, implicit};
use crate::laws::kernel::Kernel;
use crate::model::{CONTACT_REACH, DtBound, Model, TANGENTIAL, TANGENTIAL_DAMPING, TRAVEL};
use crate::scene::{
    Coupling, Damping, EquationOfState, Force, Integrator, Pressure, PressureForce, Surface, Viscosity, Wall,
};
use glam::DVec3;
use std::fmt::Write as _;
use wgpu::naga;

/// What bounds a step, by the number kernels know it by.
pub const BOUNDS: [DtBound; 10] = [
    DtBound::Flow,
    DtBound::Longest,
    DtBound::Sound,
    DtBound::Force,
    DtBound::Viscosity,
    DtBound::Contact,
    DtBound::Travel,
    DtBound::Flock,
    DtBound::Scene,
    DtBound::Frame,
];

/// The texts, in the order of the step.
const TEXTS: [&str; 20] = [
    include_str!("../../laws/kernel.wgsl"),
    include_str!("../../laws/fluid.wgsl"),
    include_str!("../../laws/contact.wgsl"),
    include_str!("../../laws/field.wgsl"),
    include_str!("../../laws/implicit.wgsl"),
    include_str!("../../laws/flock.wgsl"),
    include_str!("common.wgsl"),
    include_str!("wide.wgsl"),
    include_str!("../../integrate/particles.wgsl"),
    concat!(include_str!("../../integrate/bodies.wgsl"), include_str!("../../integrate/sleep.wgsl")),
    include_str!("../../interact/cells.wgsl"),
    include_str!("../../integrate/sources.wgsl"),
    include_str!("../../interact/density.wgsl"),
    include_str!("../../interact/boundary.wgsl"),
    include_str!("../../interact/gradients.wgsl"),
    concat!(
        include_str!("../../interact/contacts.wgsl"),
        include_str!("../../interact/forces.wgsl"),
        include_str!("ledger.wgsl")
    ),
    concat!(
        include_str!("../../interact/links.wgsl"),
        include_str!("../../interact/implicit.wgsl"),
        include_str!("../../interact/coarse.wgsl")
    ),
    concat!(include_str!("parts.wgsl"), include_str!("../../integrate/joints.wgsl")),
    include_str!("../../flock/agents.wgsl"),
    include_str!("../../flock/decide.wgsl"),
];

/// The whole text for a scene.
pub fn text(model: &Model) -> String {
    let s = &model.solver;
    let periodic = model.grid.period.map(|p| p > 0.0);
    let flat = model.dimensions == 2;
    let split = if periodic[0] { 2 } else { 1 };
    let tension = model.fluids.iter().any(|f| f.cohesion > 0.0 || f.curvature > 0.0);
    let continuity = model.integrates_density();
    let bound_code = |bound| BOUNDS.iter().position(|&b| b == bound).unwrap_or(0);
    let steady = model.dt_bounds.iter().filter(|b| !(model.implicit() && b.0 == DtBound::Contact));
    let constant = steady.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(DtBound::Frame, |b| b.0);
    let mut text = String::new();
    let switches = [
        ("FLAT", flat),
        ("PERIODIC", periodic.contains(&true)),
        ("HAS_FLUIDS", !model.fluids.is_empty()),
        ("HAS_FLOCKS", !model.flocks.is_empty()),
        ("CONTINUITY", continuity),
        ("LACKS", model.remembers_lack()),
        ("COUPLED_BY_PRESSURE", s.coupling == Coupling::Pressure),
        ("TAIT", s.equation_of_state == EquationOfState::Tait),
        ("NEGATIVE", s.negative_pressure),
        ("SYMMETRIC", s.pressure_force == PressureForce::Symmetric),
        ("NO_SLIP", model.no_slip),
        ("MUELLER", s.viscosity == Viscosity::Mueller),
        ("XSPH", s.xsph > 0.0),
        ("SHIFTING", s.shifting > 0.0),
        ("TENSION", tension),
        ("VORTICITY", s.vorticity > 0.0),
        ("CARRIED", s.xsph > 0.0 || s.shifting > 0.0 || continuity),
        ("MORTAL", mortal(model)),
        ("WALLS_SLIP", s.walls_slip),
        ("LEAPFROG", s.integrator == Integrator::Leapfrog),
        ("SMOOTH", s.surface == Surface::Smooth),
        ("IMPLICIT", model.implicit()),
        ("PBF", s.pressure == Pressure::Pbf),
        ("COARSE", model.implicit() && model.coarse()),
        ("FULL_DAMPING", s.damping == Damping::Full),
        ("RUBS", model.rubs()),
        ("SLEEPS", sleep::possible(model)),
    ];
    let numbers = [
        ("NORMAL_ONLY", if s.damping == Damping::Normal { 1.0 } else { 0.0 }),
        ("REACH", CONTACT_REACH as f32),
        ("BELOW_SUM", BELOW_SUM),
        ("SHIFTED_ABOVE", SHIFTED_ABOVE),
        ("TANGENTIAL", TANGENTIAL),
        ("TANGENTIAL_DAMPING", TANGENTIAL_DAMPING),
        ("STIFFNESS", coarse::STIFFNESS),
        ("ENOUGH", coarse::ENOUGH as f32),
        ("BEYOND", BEYOND as f32),
        ("DEEP", DEEP),
        ("HELD", HELD),
        ("TRAVEL", TRAVEL as f32),
        ("SLEEP", s.sleep as f32),
        ("SLOW", sleep::slow(model) as f32),
        ("FIRST", implicit::FIRST as f32),
        ("WORSE", implicit::WORSE as f32),
        ("WORTH", implicit::WORTH as f32),
        ("OF_ONE_SIGN", implicit::OF_ONE_SIGN as f32),
        ("NOISE", coarse::NOISE),
    ];
    let counts = [
        ("FLUIDS", model.fluids.len().max(1)),
        ("FIELDS", fields(model).count().max(1)),
        ("HAS_FIELDS", fields(model).count()),
        ("HOSES", hoses(model).count().max(1)),
        ("HAS_HOSES", hoses(model).count()),
        ("DRAINS", model.drains.len().max(1)),
        ("HAS_DRAINS", model.drains.len()),
        ("NEAREST", model.flocks.iter().map(|f| f.neighbours).max().unwrap_or(0).max(1)),
        ("JOINED", joined(model).count().max(1)),
        ("HAS_JOINED", joined(model).count()),
        ("HAS_JOINTS", model.joints.len()),
        ("COARSE_ROUNDS", coarse::ROUNDS as usize),
        ("EVERY", implicit::EVERY as usize),
        ("TURNS", implicit::TURNS as usize),
        ("BY_SOUND", bound_code(DtBound::Sound)),
        ("BY_FORCE", bound_code(DtBound::Force)),
        ("BY_CONTACT", bound_code(DtBound::Contact)),
        ("BY_FLOW", bound_code(DtBound::Flow)),
        ("BY_LONGEST", bound_code(DtBound::Longest)),
        ("BY_TRAVEL", bound_code(DtBound::Travel)),
        ("BY_SCENE", bound_code(DtBound::Scene)),
        ("BY_FRAME", bound_code(DtBound::Frame)),
        ("BY_FLOCK", bound_code(DtBound::Flock)),
        ("SOLID", (0..3).filter(|&a| model.grid.walls[a] == Wall::Solid).map(|a| 1 << a).sum()),
        ("BY_CONSTANT", bound_code(constant)),
    ];
    // writing to a string does not fail
    for (name, on) in switches {
        let _ = writeln!(text, "const {name}: bool = {on};");
    }
    for (name, value) in numbers {
        let _ = writeln!(text, "const {name}: f32 = {value:e}f;");
    }
    for (name, count) in counts {
        let _ = writeln!(text, "const {name}: u32 = {count}u;");
    }
    let rows = if flat { 3 } else { 9 };
    let _ = writeln!(
        text,
        "const SPLIT: i32 = {split};\nconst RUNS: i32 = {};\nconst SIDE: i32 = {};",
        rows * split,
        coarse::SIDE
    );
    let (w, g) = (shape(model.kernel.density()), shape(model.kernel.force()));
    let _ = writeln!(text, "fn density_w(s: f32) -> f32 {{ return {w}_w(s); }}");
    let _ = writeln!(text, "fn force_g(s: f32) -> f32 {{ return {g}_g(s); }}");
    for part in TEXTS {
        text.push_str(part);
    }
    let scan = include_str!("scan.wgsl");
    let [name, counts, starts, blocks, total] = ["NAME", "COUNTS", "STARTS", "BLOCKS", "TOTAL"];
    let all = "bins_of(STATIC)";
    text += &filled(scan, &[(name, "scan"), (counts, "counts"), (starts, "starts"), (blocks, "blocks"), (total, all)]);
    let of_agents = [
        (name, "agent_scan"),
        (counts, "agent_counts"),
        (starts, "agent_starts"),
        (blocks, "agent_blocks"),
        (total, "agent_total()"),
    ];
    text += &filled(scan, &of_agents);
    let region = include_str!("region.wgsl");
    let (grid, first) = ("GRID", "FIRST");
    text += &filled(region, &[(name, "region"), (grid, "m"), (starts, "starts"), (first, "bins_of(number)")]);
    let of_agents =
        [(name, "agent_region"), (grid, "crowd"), (starts, "agent_starts"), (first, "number * crowd.cells.w")];
    text += &filled(region, &of_agents);
    text
}

/// A template, its head left out and the names in it replaced.
fn filled(template: &str, names: &[(&str, &str)]) -> String {
    let text = template.split_once("\n\n").map_or("", |t| t.1);
    names.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// Fields that are not part of gravity.
pub fn fields(model: &Model) -> impl Iterator<Item = &Force> {
    model.fields.iter().filter(|f| !matches!(f, Force::Shake(_)))
}

/// The insides of hoses, with the velocity and the fluid of each.
pub fn hoses(model: &Model) -> impl Iterator<Item = (Bore, DVec3, u32)> {
    model.sources.iter().filter_map(|s| s.bore.map(|bore| (bore, s.velocity, s.fluid)))
}

/// Pairs of bodies that joints hold together, so that they pass through each other.
pub fn joined(model: &Model) -> impl Iterator<Item = [u32; 2]> {
    let apart = |a: usize, b: usize| model.contacts[a].joined.contains(&(b as u32));
    model.joints.iter().filter_map(move |j| j.b.filter(|&b| apart(j.a, b)).map(|b| [j.a as u32, b as u32]))
}

/// Whether some fluid has a lifetime.
pub fn mortal(model: &Model) -> bool {
    model.fluids.iter().any(|f| f.lifetime.is_finite())
}

/// Name of a kernel's functions in `laws/kernel.wgsl`.
fn shape(kernel: Kernel) -> &'static str {
    match kernel {
        Kernel::Cubic => "cubic",
        Kernel::WendlandC2 => "wendland_quintic",
        Kernel::WendlandC4 => "wendland_sextic",
        Kernel::Quintic => "quintic",
        Kernel::Poly6 => "poly_six",
        Kernel::Spiky | Kernel::Viscosity => "spiky",
    }
}

/// The text understood, or what is wrong with it.
pub fn parsed(text: &str) -> Result<(naga::Module, naga::valid::ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text))?;
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(text))?;
    Ok((module, info))
}

/// One kernel, ready to run.
#[derive(Clone)]
pub struct Kernelet {
    pub pipeline: wgpu::ComputePipeline,
    pub bound: wgpu::BindGroup,
}

/// All kernels of a scene.
pub struct Program {
    module: naga::Module,
    info: naga::valid::ModuleInfo,
    shader: wgpu::ShaderModule,
}

impl Program {
    /// Compiles the text of a scene.
    pub fn new(gpu: &Gpu, model: &Model) -> Result<Self, GpuError> {
        let text = text(model);
        let (module, info) = parsed(&text).map_err(|e| gpu.refused(e))?;
        let shader = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("jetsam"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        Ok(Self { module, info, shader })
    }

    /// Bindings that a kernel uses, in ascending order; the first is the uniform one where it is used.
    fn bindings(&self, name: &str) -> Vec<u32> {
        let Some(at) = self.module.entry_points.iter().position(|e| e.name == name) else { return Vec::new() };
        let uses = self.info.get_entry_point(at);
        let used = |(handle, variable): (naga::Handle<naga::GlobalVariable>, &naga::GlobalVariable)| {
            variable.binding.filter(|_| !uses[handle].is_empty()).map(|b| b.binding)
        };
        let mut bindings: Vec<u32> = self.module.global_variables.iter().filter_map(used).collect();
        bindings.sort_unstable();
        bindings
    }

    /// Makes a kernel, bound to `buffers` by the number of their binding.
    pub fn kernel(&self, gpu: &Gpu, name: &str, buffers: &[wgpu::Buffer]) -> Kernelet {
        let device = &gpu.device;
        let bindings = self.bindings(name);
        let entry = |&binding: &u32| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match binding {
                    0 => wgpu::BufferBindingType::Uniform,
                    _ => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(name),
            entries: &bindings.iter().map(entry).collect::<Vec<_>>(),
        });
        let whole = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&whole),
            module: &self.shader,
            entry_point: Some(name),
            compilation_options: Default::default(),
            cache: None,
        });
        let entry =
            |&binding: &u32| wgpu::BindGroupEntry { binding, resource: buffers[binding as usize].as_entire_binding() };
        let bound = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(name),
            layout: &layout,
            entries: &bindings.iter().map(entry).collect::<Vec<_>>(),
        });
        Kernelet { pipeline, bound }
    }

    /// Most storage buffers that one kernel uses.
    pub fn most_buffers(&self) -> u32 {
        let used = |e: &naga::EntryPoint| self.bindings(&e.name).iter().filter(|b| **b > 0).count();
        self.module.entry_points.iter().map(used).max().unwrap_or(0) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use crate::scene::Source;

    /// The text is valid for every choice of a scene, with no capability beyond the least a device has, and no kernel uses more
    /// buffers than eleven (Vulkan's Roadmap 2022 asks for 30, Metal has 31).
    #[test]
    fn text_is_valid_for_every_choice() {
        let choices = [
            "",
            "[world]\ndimensions = 2",
            "[solver]\ndensity = \"continuity\"\nshifting = 1.0",
            "[solver]\nviscosity = \"mueller\"\nkernel = \"mueller\"\npressure_force = \"mueller\"",
            "[solver]\npressure = \"dfsph\"\nxsph = 0.1",
            "[solver]\npressure = \"pbf\"\ncoupling = \"spring\"",
            "[solver]\nvorticity = 0.1\nxsph = 0.1\ncoupling = \"spring\"\ndamping = \"full\"",
        ];
        for choice in choices {
            let scene = format!(
                "{choice}\n[domain]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\nwalls = [\"periodic\", \"solid\", \"open\"]\n[resolution]\nspacing = 0.1\n\
                 [[fluid]]\nname = \"water\"\nsurface_tension = 0.07\nshape = {{ box = {{ min = [0, 0, 0], max = [0.5, 0.5, 0.5] }} }}\n\
                 [[force]]\nwind = {{ velocity = [1, 0, 0], rate = 1.0 }}\n"
            );
            let model = Scene::parse(Source { text: scene, ..Source::default() }, &[])
                .and_then(|s| s.assemble())
                .unwrap_or_else(|e| panic!("{e}"))
                .model;
            let text = text(&model);
            let (module, info) = parsed(&text).unwrap_or_else(|e| panic!("{choice}: {e}"));
            for (k, entry) in module.entry_points.iter().enumerate() {
                let uses = info.get_entry_point(k);
                let storage = module.global_variables.iter().filter(|(handle, variable)| {
                    matches!(variable.space, naga::AddressSpace::Storage { .. }) && !uses[*handle].is_empty()
                });
                let count = storage.count();
                assert!(count <= 11, "{} uses {count} buffers", entry.name);
            }
        }
    }
}
