// Exclusive sums of counts: inside blocks of 2048, over the blocks, and both together. A template: `backend/gpu/program.rs` puts in
// COUNTS, STARTS, BLOCKS (buffers), TOTAL (how many counts) and NAME (what the kernels' names begin with).

@compute @workgroup_size(256)
fn NAME_blocks(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let block = g.y * n.x + g.x;
  let total = TOTAL;
  let base = (block * 256u + l) * SCANNED;
  var own = 0u;
  for (var k = base; k < base + SCANNED; k += 1u) {
    if (k < total) { own += atomicLoad(&COUNTS[k]); }
  }
  let sum = scan_group(l, own);
  var at = sum.x;
  for (var k = base; k < base + SCANNED; k += 1u) {
    if (k < total && clock.running != 0u) {
      STARTS[k] = at;
      at += atomicLoad(&COUNTS[k]);
    }
  }
  if (l == 0u && block * 256u * SCANNED < total) { BLOCKS[block] = sum.y; }
}

@compute @workgroup_size(256)
fn NAME_tops(@builtin(local_invocation_index) l: u32) {
  let count = (TOTAL + 256u * SCANNED - 1u) / (256u * SCANNED);
  var before_all = 0u;
  for (var base = 0u; base < count; base += 256u) {
    let k = base + l;
    var own = 0u;
    if (k < count) { own = BLOCKS[k]; }
    let sum = scan_group(l, own);
    if (k < count) { BLOCKS[k] = before_all + sum.x; }
    before_all += sum.y;
  }
}

@compute @workgroup_size(256)
fn NAME_add(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 256u);
  if (clock.running == 0u || k >= TOTAL) { return; }
  let at = STARTS[k] + BLOCKS[k / (256u * SCANNED)];
  STARTS[k] = at;
  atomicStore(&COUNTS[k], at);
}
