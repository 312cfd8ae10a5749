//! Numbers of two floats on the device, against double precision here.

use crate::Test;
use glam::{DQuat, DVec3, DVec4};
use jetsam::gpu::Gpu;
use jetsam::random;
use wgpu::BufferUsages as Usage;

/// The tests of this file.
pub const TESTS: &[Test] = &tests![two_floats_are_forty_eight_bits];

/// The arithmetic, with what a scene's text has before it, and a kernel that tries it.
const TEXT: &str = concat!(
    "@group(0) @binding(0) var<storage, read_write> nothing: vec4<u32>;\n\
     @group(0) @binding(1) var<storage, read_write> given: array<Pair>;\n\
     @group(0) @binding(2) var<storage, read_write> found: array<Found>;\n\
     fn rounded(x: vec4<f32>) -> vec4<f32> { return bitcast<vec4<f32>>(bitcast<vec4<u32>>(x) ^ nothing); }\n",
    include_str!("../../src/backend/gpu/wide.wgsl"),
    "struct Pair { a: Wide, b: Wide }
     struct Found { sum_of_floats: Wide, product_of_floats: Wide, sum: Wide, product: Wide, quotient: Wide, dot: Wide, turn: Wide, turned: Wide }
     @compute @workgroup_size(64) fn try_all(@builtin(global_invocation_id) id: vec3<u32>) {
       let a = given[id.x].a;
       let b = given[id.x].b;
       let q = wide_turn_by(Wide(vec4<f32>(a.high.xyz, 0.0), vec4<f32>(a.low.xyz, 0.0)));
       let v = Wide(vec4<f32>(b.high.xyz, 0.0), vec4<f32>(b.low.xyz, 0.0));
       found[id.x] = Found(exact_sum(a.high, b.high), exact_product(a.high, b.high), wide_sum(a, b), wide_product(a, b),
                           wide_quotient(a, b), wide_dot(a, b), q, wide_turned(wide_unit(q), v));
     }\n"
);

/// Four numbers of two floats each.
type Wide = [[f32; 4]; 2];

fn split(numbers: [f64; 4]) -> Wide {
    let high = numbers.map(|n| n as f32);
    [high, std::array::from_fn(|k| (numbers[k] - f64::from(high[k])) as f32)]
}

fn whole(w: &Wide) -> [f64; 4] {
    std::array::from_fn(|k| f64::from(w[0][k]) + f64::from(w[1][k]))
}

/// Runs the kernel over pairs.
fn tried(pairs: &[[Wide; 2]]) -> Vec<[Wide; 8]> {
    let gpu = Gpu::open(false).unwrap_or_else(|e| panic!("{e}"));
    let (device, queue) = (&gpu.device, &gpu.queue);
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(TEXT.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("try_all"),
        compilation_options: Default::default(),
        cache: None,
    });
    let results = size_of::<[Wide; 8]>() as u64 * pairs.len() as u64;
    let buffer = |size, usage| {
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        device.create_buffer(&descriptor)
    };
    let given: &[u8] = bytemuck::cast_slice(pairs);
    let buffers =
        [16, given.len() as u64, results].map(|size| buffer(size, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC));
    queue.write_buffer(&buffers[1], 0, given);
    let entries: Vec<_> = (0u32..)
        .zip(&buffers)
        .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
        .collect();
    let layout = &pipeline.get_bind_group_layout(0);
    let bound = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries });
    let home = buffer(results, Usage::MAP_READ | Usage::COPY_DST);
    let mut commands = device.create_command_encoder(&Default::default());
    {
        let mut pass = commands.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bound, &[]);
        pass.dispatch_workgroups(pairs.len() as u32 / 64, 1, 1);
    }
    commands.copy_buffer_to_buffer(&buffers[2], 0, &home, 0, results);
    queue.submit([commands.finish()]);
    home.map_async(wgpu::MapMode::Read, .., |outcome| outcome.unwrap());
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let view = home.get_mapped_range(..).unwrap();
    view.chunks_exact(size_of::<[Wide; 8]>()).map(bytemuck::pod_read_unaligned).collect()
}

/// Sums and products of floats are exact, everything of two floats is right to 2^-44: where numbers cancel as where they do not.
fn two_floats_are_forty_eight_bits() {
    let number = |k: u64| {
        let [sign, size] = [0, 1].map(|stream| random::uniform(7, stream, k));
        (sign - 0.5).signum() * 10f64.powf(6.0 * size - 3.0)
    };
    let four = |k: u64| std::array::from_fn::<f64, 4, _>(|c| number(4 * k + c as u64));
    let pair = |k: u64| {
        let (a, b) = (four(2 * k), four(2 * k + 1));
        match k % 4 {
            0 => [a, b],
            1 => [a, a.map(|x| -x * (1.0 + 1e-7 * b[0].signum()))], // cancels
            2 => [a.map(|x| 1e-3 * x.signum() * x.abs().powf(0.2)), b], // a small turn
            _ => [a.map(|x| x.signum() * x.abs().powf(0.1)), b],    // a large one
        }
        .map(split)
    };
    let pairs: Vec<[Wide; 2]> = (0..4096).map(pair).collect();
    let found = tried(&pairs);
    let bit = 2f64.powi(-44);
    let mut worst = [0.0f64; 6];
    for ([a, b], [floats, product_of_floats, sum, product, quotient, dot, turn, turned]) in pairs.iter().zip(&found) {
        for k in 0..4 {
            let (x, y) = (f64::from(a[0][k]), f64::from(b[0][k]));
            let exact = |w: &Wide| (f64::from(w[0][k]), f64::from(w[1][k]));
            let (high, low) = exact(product_of_floats);
            assert_eq!(high + low, x * y, "{x} * {y}");
            let (high, low) = exact(floats);
            assert_eq!((high, high + low), (f64::from((x + y) as f32), x + y), "{x} + {y}");
        }
        let (a, b) = (whole(a), whole(b));
        let off = |w: &Wide, exact: &dyn Fn(usize) -> f64, scale: &dyn Fn(usize) -> f64| {
            let found = whole(w);
            (0..4).map(|k| (found[k] - exact(k)).abs() / (bit * scale(k))).fold(0.0, f64::max)
        };
        let products: f64 = (0..4).map(|k| (a[k] * b[k]).abs()).sum();
        let (angle, v) = (DVec3::new(a[0], a[1], a[2]), DVec3::new(b[0], b[1], b[2]));
        let q = DQuat::from_scaled_axis(angle);
        let (by, to) = (DVec4::from(q).to_array(), (q * v).extend(0.0).to_array());
        // squared as often as it was halved, a turn is off by as much for every radian; beyond many it is of no use
        let turns = 1.0 + angle.length();
        let all = [
            off(sum, &|k| a[k] + b[k], &|k| (a[k] + b[k]).abs()),
            off(product, &|k| a[k] * b[k], &|k| (a[k] * b[k]).abs()),
            off(quotient, &|k| a[k] / b[k], &|k| (a[k] / b[k]).abs()),
            off(dot, &|_| (0..4).map(|k| a[k] * b[k]).sum(), &|_| products),
            if turns < 50.0 { off(turn, &|k| by[k], &|_| turns) } else { 0.0 },
            if turns < 50.0 { off(turned, &|k| to[k], &|_| turns * v.length()) } else { 0.0 },
        ];
        all.iter().zip(&mut worst).for_each(|(off, worst)| *worst = worst.max(*off));
    }
    println!("sum, product, quotient, dot, turn, turned: off by {worst:.2?} of 2^-44");
    assert!(worst.iter().all(|w| *w <= 1.0), "{worst:?}");
}
