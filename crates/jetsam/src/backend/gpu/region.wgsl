// The cells that a ball touches, each once, and what stands in them. A template: `backend/gpu/program.rs` puts in GRID (what has the
// cells), STARTS (where they begin), FIRST (the first cell of the kind or flock `number`) and NAME (what the functions' names begin with).

fn NAME(x: vec3<f32>, radius: f32, number: u32) -> Region {
  let n = vec3<i32>(GRID.cells.xyz);
  let a = span(x.x, radius, GRID.origin.x, GRID.per_cell.x, n.x, m.period.x);
  var b = span(x.y, radius, GRID.origin.y, GRID.per_cell.y, n.y, m.period.y);
  if (FLAT) { b = vec2<i32>(0, 1); }
  let c = span(x.z, radius, GRID.origin.z, GRID.per_cell.z, n.z, m.period.z);
  return Region(vec3<i32>(a.x, b.x, c.x), vec3<i32>(a.y, b.y, c.y), FIRST, -1, 0u, 0u);
}
fn NAME_run(r: Region, run: i32) -> vec2<u32> {
  let n = vec3<i32>(GRID.cells.xyz);
  let along = select(1, r.size.x, SPLIT == 2);      // cell by cell on a periodic axis
  let row = run / along;
  let y = wrapped(r.low.y + row % r.size.y, n.y);
  let z = wrapped(r.low.z + row / r.size.y, n.z);
  let base = r.bins + (u32(z) * GRID.cells.y + u32(y)) * GRID.cells.x;
  if (SPLIT == 2) {
    let x = base + u32(wrapped(r.low.x + run % along, n.x));
    return vec2<u32>(STARTS[x], STARTS[x + 1u]);
  }
  return vec2<u32>(STARTS[base + u32(r.low.x)], STARTS[base + u32(r.low.x + r.size.x)]);
}
fn NAME_next(r: ptr<function, Region>) -> bool {
  (*r).at += 1u;
  while ((*r).at >= (*r).end) {
    (*r).run += 1;
    if ((*r).run >= (*r).size.y * (*r).size.z * select(1, (*r).size.x, SPLIT == 2)) { return false; }
    let run = NAME_run(*r, (*r).run);
    (*r).at = run.x;
    (*r).end = run.y;
  }
  return true;
}

