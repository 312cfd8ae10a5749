//! Times a torus knot of 72,000 triangles on its way to 1,000,000 particles, by both rules, and says what memory it takes.
//! The parity rule also on the GPU, if there is one, even a software one: the whole call, and the kernels alone.
//! `cargo run --release -p jetsam --example voxelize_bench [-- runs]`

use jetsam::mesh::Mesh;
use jetsam::voxelize::{Backend, Resolution, Rule, VoxelizeOptions, Voxelizer, voxelize};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let runs: usize = std::env::args().nth(1).map_or(Ok(15), |a| a.parse())?;
    let knot = Mesh::torus_knot(2, 3, 1.0, 0.3, 1200, 30);
    let wanted = VoxelizeOptions { resolution: Resolution::Particles(1_000_000), ..Default::default() };
    let spacing = voxelize(&knot, &wanted)?.spacing;
    // The same knot with every tenth strip of triangles missing: long rims, so that the tree has to work.
    let mut torn = knot.clone();
    torn.triangles.retain(|t| t[0] % 300 > 3);
    for (name, mesh) in [("closed", &knot), ("torn", &torn)] {
        for rule in [Rule::Parity, Rule::Winding] {
            let options = VoxelizeOptions { rule, resolution: Resolution::Spacing(spacing), ..Default::default() };
            let mut millis = Vec::new();
            let mut last = None;
            for _ in 0..if name == "torn" { 1 } else { runs } {
                let voxels = voxelize(mesh, &options)?;
                millis.push(voxels.report.millis);
                last = Some(voxels);
            }
            millis.sort_by(f64::total_cmp);
            let Some(voxels) = last else { continue };
            println!(
                "{name} {rule:?}: {} triangles, {} particles, {:?} cells, {:.1} ms median, {:.1} ms best, {:.2} bits a cell",
                mesh.triangles.len(),
                voxels.len(),
                voxels.dims,
                millis[millis.len() / 2],
                millis[0],
                voxels.bits.words().len() as f64 * 64.0 / voxels.dims.iter().map(|d| f64::from(*d)).product::<f64>(),
            );
        }
    }
    match Voxelizer::new(Backend::Gpu) {
        Ok(gpu) => bench_gpu(&gpu, &knot, spacing, runs)?,
        Err(e) => println!("closed Parity on the GPU: {e}"),
    }
    Ok(())
}

fn bench_gpu(gpu: &Voxelizer, knot: &Mesh, spacing: f64, runs: usize) -> Result<(), Box<dyn std::error::Error>> {
    let options =
        VoxelizeOptions { rule: Rule::Parity, resolution: Resolution::Spacing(spacing), ..Default::default() };
    let (mut whole, mut kernels, mut backend) = (Vec::new(), Vec::new(), String::new());
    for _ in 0..runs {
        let report = gpu.voxelize(knot, &options)?.report;
        whole.push(report.millis);
        kernels.extend(report.kernel_millis);
        backend = report.backend;
    }
    whole.sort_by(f64::total_cmp);
    kernels.sort_by(f64::total_cmp);
    let kernels = kernels.get(kernels.len() / 2).map_or_else(
        || "no clock on the device".to_string(),
        |k| format!("kernels {k:.3} ms median, {:.3} ms best", kernels[0]),
    );
    println!("closed Parity on {backend}: {:.1} ms median, {:.1} ms best; {kernels}", whole[whole.len() / 2], whole[0],);
    Ok(())
}
