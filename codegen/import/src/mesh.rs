//! Reads triangle meshes from STL and OBJ files, and computes their volume, centre of mass and
//! inertia.

use std::collections::BTreeMap;

use crate::pose::{V3, cross, difference, dot, norm, scaled, sum};

/// The number of bytes before the triangles of a binary STL file.
const HEAD: usize = 84;
/// The number of bytes of each of its triangles.
const TRIANGLE: usize = 50;

/// A solid of density 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solid {
    /// The volume, m^3.
    pub(crate) volume: f64,
    /// The centre of mass in the frame of the mesh, m.
    pub(crate) centre: V3,
    /// The inertia tensor about the centre of mass: xx, xy, xz, yy, yz, zz, m^5.
    pub(crate) tensor: [f64; 6],
}

/// The corners of a triangle.
pub(crate) type Triangle = [V3; 3];

/// How the volume that a mesh encloses is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Volume {
    /// The volume that a closed surface bounds.
    Exact,
    /// The tetrahedra from one point to the triangles, each with the absolute value of its volume.
    /// For convex meshes the result is the same; parts of others count more than once. The surface
    /// need not be closed. This is MuJoCo's default, which it calls `legacy`.
    EachTriangle,
}

/// The triangles of a mesh file.
///
/// # Errors
/// The reason in words, if the file is neither STL nor OBJ, or malformed.
pub(crate) fn triangles(name: &str, bytes: &[u8]) -> Result<Vec<Triangle>, &'static str> {
    let ending = name.rsplit('.').next().unwrap_or("").to_ascii_lowercase();
    let triangles = match ending.as_str() {
        "stl" => stl(bytes),
        "obj" => std::str::from_utf8(bytes).ok().and_then(obj),
        _ => return Err("only STL and OBJ are read"),
    };
    triangles.ok_or("its triangles cannot be read")
}

/// The solid of triangles, with each axis multiplied by a factor.
///
/// # Errors
/// The reason in words, if the surface is not closed although [`Volume::Exact`] needs that, or if it
/// encloses no volume.
pub(crate) fn solid(
    triangles: &[Triangle],
    factors: V3,
    volume: Volume,
) -> Result<Solid, &'static str> {
    if volume == Volume::Exact && !is_closed(triangles) {
        return Err("its surface is not closed");
    }
    let place = |corner: V3| core::array::from_fn(|k| corner[k] * factors[k]);
    let placed: Vec<Triangle> = triangles.iter().map(|t| t.map(place)).collect();
    let (from, counted): (V3, fn(f64) -> f64) = match volume {
        Volume::Exact => ([0.0; 3], |volume| volume),
        Volume::EachTriangle => (middle(&placed), f64::abs),
    };
    let (whole, first, _) = moments(&placed, from, counted);
    let centre = sum(from, scaled(first, 1.0 / whole));
    let (own, _, second) = moments(&placed, centre, counted);
    // the signed volume is negative if the factors mirror the mesh or its triangles face inwards
    let side = whole.signum();
    let volume = own * side;
    let [xx, xy, xz, yy, yz, zz] = second.map(|x| x * side);
    let tensor = [yy + zz, -xy, -xz, xx + zz, -yz, xx + yy];
    let numbers = tensor.iter().chain(&centre);
    if volume > 0.0 && numbers.chain([&volume]).all(|x| x.is_finite()) {
        Ok(Solid {
            volume,
            centre,
            tensor,
        })
    } else {
        Err("it has no volume")
    }
}

/// The volume and the first and second moments (xx, xy, xz, yy, yz, zz) of the tetrahedra from a
/// point to each triangle, about that point. `counted` maps the signed volume of a tetrahedron to
/// the volume that counts.
fn moments(triangles: &[Triangle], from: V3, counted: fn(f64) -> f64) -> (f64, V3, [f64; 6]) {
    let (mut volume, mut first, mut second) = (0.0, [0.0; 3], [0.0; 6]);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|corner| difference(corner, from));
        let own = counted(dot(a, cross(b, c)) / 6.0);
        let all = sum(a, sum(b, c));
        volume += own;
        first = sum(first, scaled(all, own / 4.0));
        let pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (entry, (i, j)) in second.iter_mut().zip(pairs) {
            let corners = a[i] * a[j] + b[i] * b[j] + c[i] * c[j];
            *entry += own / 20.0 * (all[i] * all[j] + corners);
        }
    }
    (volume, first, second)
}

/// The centre of mass of the triangles' areas.
fn middle(triangles: &[Triangle]) -> V3 {
    let (mut area, mut first) = (0.0, [0.0; 3]);
    for [a, b, c] in triangles {
        let own = norm(cross(difference(*b, *a), difference(*c, *a)));
        area += own;
        first = sum(first, scaled(sum(*a, sum(*b, *c)), own / 3.0));
    }
    scaled(first, 1.0 / area)
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
        let (triangles, _) = bytes[HEAD..].as_chunks::<TRIANGLE>();
        return triangles
            .iter()
            .map(|t| finite(binary_triangle(t)?))
            .collect();
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
    let (triangles, rest) = corners.as_chunks::<3>();
    rest.is_empty()
        .then(|| triangles.iter().map(|t| finite(*t)).collect())?
}

/// The corners of a triangle in a binary STL file, which follow its normal.
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

    fn read(name: &str, bytes: &[u8], factors: V3) -> Result<Solid, &'static str> {
        solid(&triangles(name, bytes)?, factors, Volume::Exact)
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
        is_block(read("block.OBJ", text.as_bytes(), [1.0; 3]).unwrap(), size);
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
            is_block(read("block.stl", bytes, [1.0; 3]).unwrap(), size);
        }
        // factors, and one that mirrors
        let found = read("block.stl", &binary, [2.0, -1.0, 1.0]).unwrap();
        let expected = read("block.stl", &binary, [2.0, 1.0, 1.0]).unwrap();
        assert_near(&found.centre, &[0.2, -0.25, 0.75]);
        assert_near(&found.tensor, &expected.tensor);
    }

    #[test]
    fn a_body_that_is_no_box_has_products_of_inertia() {
        let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
        let faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        let found = read("a.obj", (corners.to_owned() + faces).as_bytes(), [1.0; 3]).unwrap();
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
            read("a.obj", open.as_bytes(), [1.0; 3]).unwrap_err(),
            "its surface is not closed"
        );
        assert_eq!(
            read("a.obj", text.as_bytes(), [0.0; 3]).unwrap_err(),
            "it has no volume"
        );
        assert_eq!(
            read("a.dae", b"", [1.0; 3]).unwrap_err(),
            "only STL and OBJ are read"
        );
        for broken in [
            &b"f 1 2 3"[..],
            b"v 1 2\n",
            b"v 1 2 nan\nf 1 1 1",
            b"f 0 0 0",
            b"f -1 -1 -9223372036854775808",
        ] {
            assert!(read("a.obj", broken, [1.0; 3]).is_err(), "{broken:?}");
        }
        for broken in [
            &b""[..],
            b"solid",
            b"solid vertex 1 2",
            b"solid vertex 1 2 3",
            &[255; 90],
        ] {
            assert!(read("a.stl", broken, [1.0; 3]).is_err(), "{broken:?}");
        }
    }

    /// The numbers are MuJoCo 4.0.0's for `inertia="exact"` and `inertia="legacy"`, at 1 kg/m^3.
    #[test]
    fn parts_of_what_is_not_convex_count_as_in_mujoco() {
        // an L of three squares, 1.5 high, without and with its top
        let flat = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 2], [0, 2]];
        let corner = |k: usize| -> V3 {
            let [x, y] = flat[k % 6].map(f64::from);
            [x, y, if k < 6 { 0.0 } else { 1.5 }]
        };
        let mut open: Vec<[usize; 3]> = vec![[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 5, 4]];
        for (i, j) in (0..6).map(|i| (i, (i + 1) % 6)) {
            open.extend([[i, j, j + 6], [i, j + 6, i + 6]]);
        }
        let mut whole = open.clone();
        whole.extend([[6, 7, 8], [6, 8, 9], [6, 9, 10], [6, 10, 11]]);
        let placed = |faces: &[[usize; 3]], volume| {
            let triangles: Vec<Triangle> = faces.iter().map(|face| face.map(corner)).collect();
            solid(&triangles, [0.1, 0.2, -0.1], volume)
        };
        let exact = placed(&whole, Volume::Exact).unwrap();
        let each = placed(&whole, Volume::EachTriangle).unwrap();
        let cup = placed(&open, Volume::EachTriangle).unwrap();
        let centres = [
            [0.125, 0.15, -0.075],
            [0.124_289_88, 0.154_260_71, -0.075],
            [0.124_288_12, 0.154_271_3, -0.061_595_88],
        ];
        let volumes = [0.012, 0.012_485_797_62, 0.010_128_319_12];
        let principal = [0.085 + 0.1825 + 0.2225, 0.506_209_93, 0.436_010_92];
        for (k, found) in [exact, each, cup].iter().enumerate() {
            assert!((found.volume - volumes[k]).abs() < 1e-11, "{found:?}");
            for (x, y) in found.centre.iter().zip(centres[k]) {
                assert!((x - y).abs() < 1e-8, "{found:?}");
            }
            let trace = found.tensor[0] + found.tensor[3] + found.tensor[5];
            assert!((trace - 1e-3 * principal[k]).abs() < 1e-10, "{found:?}");
        }
        assert!(placed(&open, Volume::Exact).is_err());
    }
}
