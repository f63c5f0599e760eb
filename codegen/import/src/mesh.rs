//! Volume, centre and inertia of solids whose surface is a mesh of triangles in STL or OBJ.

use std::collections::BTreeMap;

use crate::pose::{V3, cross, dot, scaled, sum};

/// The number of bytes before the triangles of a binary STL file, and of each triangle.
const HEAD: usize = 84;
const TRIANGLE: usize = 50;

/// A solid of density 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solid {
    /// In m^3.
    pub(crate) volume: f64,
    /// The centre of mass, in m.
    pub(crate) centre: V3,
    /// Moments of inertia about the centre: xx, xy, xz, yy, yz, zz, in m^5.
    pub(crate) tensor: [f64; 6],
}

type Triangle = [V3; 3];

/// The solid that a mesh file bounds, with each axis multiplied by a factor.
///
/// # Errors
/// In words, if the file is in no format that is read here, or if its surface is not closed: what
/// it bounds has no volume then.
pub(crate) fn solid(name: &str, bytes: &[u8], factors: V3) -> Result<Solid, &'static str> {
    let ending = name.rsplit('.').next().unwrap_or("").to_ascii_lowercase();
    let triangles = match ending.as_str() {
        "stl" => stl(bytes),
        "obj" => std::str::from_utf8(bytes).ok().and_then(obj),
        _ => return Err("only STL and OBJ are read"),
    };
    let triangles = triangles.ok_or("its triangles cannot be read")?;
    bounded(&triangles, factors)
}

/// The solid bounded by triangles, with each axis multiplied by a factor.
///
/// # Errors
/// In words, if the surface is not closed.
pub(crate) fn bounded(triangles: &[Triangle], factors: V3) -> Result<Solid, &'static str> {
    if !is_closed(triangles) {
        return Err("its surface is not closed");
    }
    // tetrahedra from the origin to each triangle, with signed volumes
    let (mut volume, mut first, mut second) = (0.0, [0.0; 3], [0.0; 6]);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|corner| core::array::from_fn(|k| corner[k] * factors[k]));
        let sixfold = dot(a, cross(b, c));
        let all = sum(a, sum(b, c));
        volume += sixfold / 6.0;
        first = sum(first, scaled(all, sixfold / 24.0));
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (entry, (i, j)) in second.iter_mut().zip(pairs) {
            let own = a[i] * a[j] + b[i] * b[j] + c[i] * c[j];
            *entry += sixfold / 120.0 * (all[i] * all[j] + own);
        }
    }
    // mirrored, or with triangles that are seen from inside
    let side = volume.signum();
    let (volume, first, second) = (volume * side, scaled(first, side), second.map(|x| x * side));
    let centre = scaled(first, 1.0 / volume);
    if !(volume > 0.0 && volume.is_finite() && centre.iter().all(|x| x.is_finite())) {
        return Err("it has no volume");
    }
    let [x, y, z] = centre;
    let of_centre = [x * x, x * y, x * z, y * y, y * z, z * z];
    let [xx, xy, xz, yy, yz, zz] = core::array::from_fn(|k| second[k] - volume * of_centre[k]);
    Ok(Solid {
        volume,
        centre,
        tensor: [yy + zz, -xy, -xz, xx + zz, -yz, xx + yy],
    })
}

/// Whether each edge is passed as often in one direction as in the other.
fn is_closed(triangles: &[Triangle]) -> bool {
    let key = |corner: V3| corner.map(|x| (x + 0.0).to_bits());
    let mut edges: BTreeMap<_, i64> = BTreeMap::new();
    for triangle in triangles {
        let [a, b, c] = triangle.map(key);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from != to {
                let (edge, passes) = if from < to {
                    ((from, to), 1)
                } else {
                    ((to, from), -1)
                };
                *edges.entry(edge).or_default() += passes;
            }
        }
    }
    !triangles.is_empty() && edges.values().all(|passes| *passes == 0)
}

fn stl(bytes: &[u8]) -> Option<Vec<Triangle>> {
    let count = bytes.get(80..HEAD).and_then(|b| b.try_into().ok());
    let count = count
        .map(u32::from_le_bytes)
        .and_then(|n| usize::try_from(n).ok());
    let length = count.and_then(|n| n.checked_mul(TRIANGLE)?.checked_add(HEAD));
    if length == Some(bytes.len()) {
        let triangles = bytes[HEAD..].chunks_exact(TRIANGLE);
        return triangles.map(|t| finite(binary_triangle(t)?)).collect();
    }
    let mut corners = Vec::new();
    let mut words = std::str::from_utf8(bytes).ok()?.split_whitespace();
    if words.next() != Some("solid") {
        return None;
    }
    while let Some(word) = words.next() {
        if word == "vertex" {
            corners.push(point(&mut words)?);
        }
    }
    let triangles = corners.chunks_exact(3);
    let whole = triangles.remainder().is_empty();
    whole.then(|| triangles.map(|t| finite([t[0], t[1], t[2]])).collect())?
}

/// The corners of a triangle in a binary STL file, behind its normal.
fn binary_triangle(bytes: &[u8]) -> Option<Triangle> {
    let (numbers, _) = bytes.get(12..48)?.as_chunks::<4>();
    let at = |k: usize| f64::from(f32::from_le_bytes(numbers[k]));
    Some(core::array::from_fn(|c| {
        core::array::from_fn(|k| at(3 * c + k))
    }))
}

fn obj(text: &str) -> Option<Vec<Triangle>> {
    let mut corners: Vec<V3> = Vec::new();
    let mut triangles = Vec::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => corners.push(point(&mut words)?),
            Some("f") => {
                let face = words.map(|word| {
                    let number: i64 = word.split('/').next()?.parse().ok()?;
                    let index = match usize::try_from(number) {
                        Ok(from_start) => from_start.checked_sub(1)?,
                        Err(_) => corners.len().checked_sub(usize::try_from(-number).ok()?)?,
                    };
                    corners.get(index).copied()
                });
                let face: Vec<V3> = face.collect::<Option<_>>()?;
                for pair in face.get(1..)?.windows(2) {
                    triangles.push(finite([face[0], pair[0], pair[1]])?);
                }
            }
            _ => {}
        }
    }
    Some(triangles)
}

fn point<'a>(words: &mut impl Iterator<Item = &'a str>) -> Option<V3> {
    let mut next = || words.next()?.parse::<f64>().ok();
    Some([next()?, next()?, next()?])
}

fn finite(triangle: Triangle) -> Option<Triangle> {
    triangle
        .iter()
        .flatten()
        .all(|x| x.is_finite())
        .then_some(triangle)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;

    /// A box from the origin to a corner, its sides as squares seen from outside.
    fn block([a, b, c]: V3) -> String {
        let mut text = String::new();
        for k in 0..8 {
            let at = |bit: usize, length: f64| if k >> bit & 1 == 1 { length } else { 0.0 };
            let _ = writeln!(text, "v {} {} {}", at(0, a), at(1, b), at(2, c));
        }
        text + "f 1 3 4 2\nf 5/1 6/2 8/3 7/4\nf 1 2 6 5\nf 3//1 7//1 8//1 4//1\nf 1 5 7 3\nf -7 -5 -1 -3\n"
    }

    fn assert_near(found: &[f64], expected: &[f64]) {
        for (x, y) in found.iter().zip(expected) {
            assert!((x - y).abs() < 1e-6, "{found:?} {expected:?}");
        }
    }

    fn is_block(solid: Solid, [a, b, c]: V3) {
        let m = a * b * c;
        let moment = |p: f64, q: f64| m * (p * p + q * q) / 12.0;
        assert_near(&[solid.volume], &[m]);
        assert_near(&solid.centre, &[a / 2.0, b / 2.0, c / 2.0]);
        let tensor = [moment(b, c), 0.0, 0.0, moment(a, c), 0.0, moment(a, b)];
        assert_near(&solid.tensor, &tensor);
    }

    #[test]
    fn a_box_has_its_volume_centre_and_inertia_in_every_format() {
        let size = [0.2, 0.5, 1.5];
        let text = block(size);
        is_block(solid("block.OBJ", text.as_bytes(), [1.0; 3]).unwrap(), size);
        let triangles = obj(&text).unwrap();
        let mut ascii = "solid block\n".to_owned();
        let mut binary = vec![b's'; 80];
        binary.extend(u32::to_le_bytes(12));
        for triangle in &triangles {
            ascii += "facet normal 0 0 0\nouter loop\n";
            binary.extend([0; 12]);
            for [x, y, z] in triangle {
                let _ = writeln!(ascii, "vertex {x:e} {y} {z}");
                binary.extend([x, y, z].iter().flat_map(|v| (**v as f32).to_le_bytes()));
            }
            ascii += "endloop\nendfacet\n";
            binary.extend([0; 2]);
        }
        for bytes in [ascii.as_bytes(), &binary] {
            is_block(solid("block.stl", bytes, [1.0; 3]).unwrap(), size);
        }
        // factors, and one that mirrors
        let found = solid("block.stl", &binary, [2.0, -1.0, 1.0]).unwrap();
        let expected = solid("block.stl", &binary, [2.0, 1.0, 1.0]).unwrap();
        assert_near(&found.centre, &[0.2, -0.25, 0.75]);
        assert_near(&found.tensor, &expected.tensor);
    }

    #[test]
    fn a_body_that_is_no_box_has_products_of_inertia() {
        let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
        let faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        let found = solid("a.obj", (corners.to_owned() + faces).as_bytes(), [1.0; 3]).unwrap();
        assert_near(&[found.volume], &[1.0 / 6.0]);
        assert_near(&found.centre, &[0.25; 3]);
        // integrals over the tetrahedron: x^2 is 1/60, x y is 1/120
        let (diagonal, product) = (1.0 / 60.0 - 1.0 / 96.0, 1.0 / 120.0 - 1.0 / 96.0);
        let (i, p) = (2.0 * diagonal, -product);
        assert_near(&found.tensor, &[i, p, p, i, p, i]);
    }

    #[test]
    fn what_bounds_nothing_is_refused() {
        let text = block([1.0; 3]);
        let open = text.replace("f 1 2 6 5\n", "");
        assert_eq!(
            solid("a.obj", open.as_bytes(), [1.0; 3]).unwrap_err(),
            "its surface is not closed"
        );
        assert_eq!(
            solid("a.obj", text.as_bytes(), [0.0; 3]).unwrap_err(),
            "it has no volume"
        );
        assert_eq!(
            solid("a.dae", b"", [1.0; 3]).unwrap_err(),
            "only STL and OBJ are read"
        );
        for broken in [
            &b"f 1 2 3"[..],
            b"v 1 2\n",
            b"v 1 2 nan\nf 1 1 1",
            b"f 0 0 0",
            b"f -1 -1 -9223372036854775808",
        ] {
            assert!(solid("a.obj", broken, [1.0; 3]).is_err(), "{broken:?}");
        }
        for broken in [
            &b""[..],
            b"solid",
            b"solid vertex 1 2",
            b"solid vertex 1 2 3",
            &[255; 90],
        ] {
            assert!(solid("a.stl", broken, [1.0; 3]).is_err(), "{broken:?}");
        }
    }
}
