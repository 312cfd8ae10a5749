// Numbers of two floats: what rounding leaves over of `high` stands in `low`, some 48 bits together (Dekker 1971; Knuth 1969; Hida, Li
// and Bailey 2001). Four at a time: a vector leaves the fourth at 0, an orientation uses all. Bodies are integrated in them, and
// energies summed. What must be rounded before it is used goes through `rounded`, where no compiler sees that nothing happens: some take
// (a + b) - a for b, fuse a product into the sum after it, or gather factors (a factor of 1 does not keep them from it).

struct Wide { high: vec4<f32>, low: vec4<f32> }

fn wide(x: vec4<f32>) -> Wide { return Wide(x, vec4<f32>(0.0)); }
fn wide_vector(x: vec3<f32>) -> Wide { return wide(vec4<f32>(x, 0.0)); }

// The sum of two floats, the first the larger by far or zero.
fn settled(high: vec4<f32>, low: vec4<f32>) -> Wide {
  let sum = rounded(high + low);
  return Wide(sum, low - (sum - high));
}
// The exact sum of two floats (Knuth).
fn exact_sum(a: vec4<f32>, b: vec4<f32>) -> Wide {
  let sum = rounded(a + b);
  let of_b = rounded(sum - a);
  return Wide(sum, (a - rounded(sum - of_b)) + (b - of_b));
}
// The exact product (Dekker): products of the halves of two floats are exact, fused with a sum or not.
fn upper_half(x: vec4<f32>) -> vec4<f32> { return bitcast<vec4<f32>>(bitcast<vec4<u32>>(x) & vec4<u32>(0xfffff000u)); }
fn exact_product(a: vec4<f32>, b: vec4<f32>) -> Wide {
  let product = rounded(a * b);
  let upper_a = upper_half(a);
  let upper_b = upper_half(b);
  let lower_a = a - upper_a;
  let lower_b = b - upper_b;
  return Wide(product, ((upper_a * upper_b - product) + upper_a * lower_b + lower_a * upper_b) + lower_a * lower_b);
}

fn negated(a: Wide) -> Wide { return Wide(-a.high, -a.low); }
fn wide_sum(a: Wide, b: Wide) -> Wide {
  let high = exact_sum(a.high, b.high);
  let low = exact_sum(a.low, b.low);
  let sum = settled(high.high, high.low + low.high);
  return settled(sum.high, sum.low + low.low);
}
fn wide_product(a: Wide, b: Wide) -> Wide {
  let product = exact_product(a.high, b.high);
  return settled(product.high, product.low + (a.high * b.low + a.low * b.high));
}
fn wide_quotient(a: Wide, b: Wide) -> Wide {
  let first = wide(a.high / b.high);
  let rest = wide_sum(a, negated(wide_product(first, b)));
  return settled(first.high, rest.high / b.high);
}
fn scaled(a: Wide, by: f32) -> Wide { return wide_product(a, wide(vec4<f32>(by))); }

// The sum of the products of four, in all places.
fn wide_dot(a: Wide, b: Wide) -> Wide {
  let p = wide_product(a, b);
  let xy = wide_sum(Wide(p.high.xxxx, p.low.xxxx), Wide(p.high.yyyy, p.low.yyyy));
  return wide_sum(xy, wide_sum(Wide(p.high.zzzz, p.low.zzzz), Wide(p.high.wwww, p.low.wwww)));
}

// Quaternions, the real part last.
fn wide_times(a: Wide, b: Wide) -> Wide {
  let sign = vec4<f32>(1.0, 1.0, 1.0, -1.0);
  let real = wide_product(Wide(a.high.wwww, a.low.wwww), b);
  let x = wide_product(Wide(a.high.xyzx * sign, a.low.xyzx * sign), Wide(b.high.wwwx, b.low.wwwx));
  let y = wide_product(Wide(a.high.yzxy * sign, a.low.yzxy * sign), Wide(b.high.zxyy, b.low.zxyy));
  let z = wide_product(Wide(a.high.zxyz, a.low.zxyz), Wide(b.high.yzxz, b.low.yzxz));
  return wide_sum(wide_sum(real, x), wide_sum(y, negated(z)));
}
fn inverse_turn(q: Wide) -> Wide {
  let sign = vec4<f32>(-1.0, -1.0, -1.0, 1.0);
  return Wide(q.high * sign, q.low * sign);
}
// A vector turned by q.
fn wide_turned(q: Wide, v: Wide) -> Wide {
  let t = wide_times(wide_times(q, v), inverse_turn(q));
  return Wide(vec4<f32>(t.high.xyz, 0.0), vec4<f32>(t.low.xyz, 0.0));
}
// The turn by a vector (rad): by the series of a part so small that five terms suffice, squared as often as it was halved.
fn wide_turn_by(angle: Wide) -> Wide {
  var half = scaled(angle, 0.5);
  var square = wide_dot(half, half);
  var halved = 0u;
  while (square.high.x > 0.02 && halved < 16u) {
    half = scaled(half, 0.5);
    square = scaled(square, 0.25);
    halved += 1u;
  }
  // sine over the angle in three places, cosine in the last
  let one = wide(vec4<f32>(1.0));
  var series = one;
  for (var k = 8.0; k > 0.0; k -= 2.0) {
    let divisor = vec4<f32>(vec3<f32>(k * (k + 1.0)), k * (k - 1.0));
    series = wide_sum(one, negated(wide_quotient(wide_product(square, series), wide(divisor))));
  }
  var q = wide_product(series, Wide(vec4<f32>(half.high.xyz, 1.0), vec4<f32>(half.low.xyz, 0.0)));
  for (; halved > 0u; halved -= 1u) { q = wide_times(q, q); }
  return q;
}
// An orientation brought back to length 1, of which it misses little.
fn wide_unit(q: Wide) -> Wide {
  let excess = wide_sum(wide_dot(q, q), wide(vec4<f32>(-1.0)));
  return wide_sum(q, wide(-0.5 * excess.high * q.high));
}
