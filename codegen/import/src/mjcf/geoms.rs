//! The inertia of bodies without `<inertial>`, computed from their geoms.

use std::f64::consts::PI;

use super::Reading;
use super::orientation::Classed;
use crate::pose::{
    Pose, UNIT, V3, difference, norm, onto, scaled, sum, tensor_in, transposed, unit,
};
use crate::tree::Inertia;
use crate::xml::Element;

/// The density of geoms that state none, kg/m^3, as in MuJoCo.
const DENSITY: f64 = 1000.0;

impl Reading<'_, '_, '_> {
    /// The inertia of all geoms of a body in the body's frame; `around` is the pose of the geoms'
    /// frame in the body's. If the body `moves`, what is not known of its mass is noted.
    pub(super) fn inertia_of_geoms(
        &mut self,
        geoms: &[(&Element, Option<&str>, Pose)],
        moves: bool,
        body: &str,
    ) -> Option<Inertia> {
        let mut parts = Vec::new();
        let (mut unknown, mut read) = (None, false);
        for (element, inherited, around) in geoms {
            let of = Classed {
                element,
                inherited: *inherited,
            };
            match self.geom(of) {
                Geom::Mesh(mesh) => match self.solid_of_mesh(of, mesh.as_deref()) {
                    Ok((pose, mass, tensor)) => {
                        parts.push((around.then(&pose), mass, tensor));
                        read = true;
                    }
                    Err(why) => unknown = unknown.or(Some(why)),
                },
                Geom::Solid(pose, mass, tensor) if mass > 0.0 => {
                    parts.push((around.then(&pose), mass, tensor));
                }
                Geom::Solid(..) => {}
            }
        }
        self.left_out.has_unknown_mass = unknown.is_some();
        let place = geoms.first().map(|(first, ..)| first.place);
        if let Some(place) = place.filter(|_| moves) {
            let text = match &unknown {
                Some(why) => Some(format!(
                    "bodies without values, since their mass is in meshes that are not read ({why}): {{}} \
                     (MuJoCo writes inertials with mj_saveLastXML)"
                )),
                None if read => Some(format!(
                    "mass from meshes, as MuJoCo counts it (parts of meshes that are not convex more than once, \
                     unless the mesh has inertia=\"exact\"), with {DENSITY} kg/m^3 where no density is \
                     given: {{}}"
                )),
                None => None,
            };
            if let Some(text) = text {
                let item = format!("'{body}'");
                self.fields.log.note_of(place, text, &item);
            }
        }
        if unknown.is_some() {
            None
        } else {
            combined(&parts)
        }
    }

    /// The inertia of a geom that is a mesh: the frame at the centre of mass, the mass and the
    /// tensor. The error says why it is not known.
    fn solid_of_mesh(
        &mut self,
        of: Classed<'_>,
        mesh: Option<&str>,
    ) -> Result<(Pose, f64, [f64; 6]), String> {
        let name = mesh.ok_or("a shape fitted to a mesh has no size here")?;
        let is_shell = self.attribute(of, "shellinertia");
        if is_shell.is_some_and(|a| a.value == "true") {
            return Err("shells are not computed".to_owned());
        }
        let solid = self.mesh(name)?;
        let (mass, density) = self.mass(of);
        let mass = mass.unwrap_or(density * solid.volume);
        let pose = self.pose(of).then(&Pose::shift(solid.centre));
        Ok((pose, mass, solid.tensor.map(|x| x * mass / solid.volume)))
    }

    /// The mass of a geom, if it is given, and its density.
    fn mass(&mut self, of: Classed<'_>) -> (Option<f64>, f64) {
        let mut number = |name: &str| {
            let attribute = self.attribute(of, name)?;
            self.fields.number(&attribute)
        };
        (number("mass"), number("density").unwrap_or(DENSITY))
    }

    /// Whether the body that was read last has meshes of unknown mass; the answer is then reset.
    pub(super) fn take_has_unknown_mass(&mut self) -> bool {
        core::mem::take(&mut self.left_out.has_unknown_mass)
    }

    fn geom(&mut self, of: Classed<'_>) -> Geom {
        of.element.used.mark();
        let (mass, density) = self.mass(of);
        let group = self.attribute(of, "group");
        let group = group.and_then(|a| self.fields.number(&a)).unwrap_or(0.0);
        let [low, high] = self.compiler.groups;
        let nothing = Geom::Solid(Pose::default(), 0.0, [0.0; 6]);
        if !(low..=high).contains(&group) || mass.map_or(density == 0.0, |m| m == 0.0) {
            return nothing;
        }
        let kind = self.attribute(of, "type");
        let kind = kind.map_or_else(|| "sphere".to_owned(), |a| a.value);
        if matches!(kind.as_str(), "plane" | "hfield") {
            return nothing;
        }
        let mesh = self.attribute(of, "mesh");
        if matches!(kind.as_str(), "mesh" | "sdf") || mesh.is_some() {
            let is_mesh = kind == "mesh" || self.attribute(of, "type").is_none();
            return Geom::Mesh(mesh.filter(|_| is_mesh).map(|a| a.value));
        }
        let size = self.attribute(of, "size");
        let mut size = size
            .and_then(|a| self.fields.numbers(&a))
            .unwrap_or_default();
        let mut pose = self.pose(of);
        let ends = self.attribute(of, "fromto");
        if let Some([a, b, c, d, e, f]) = ends.and_then(|a| self.fields.array::<6>(&a)) {
            let (from, to) = ([a, b, c], [d, e, f]);
            let along = difference(to, from);
            let r = unit(along).map_or(UNIT, onto);
            pose = Pose::new(scaled(sum(from, to), 0.5), r);
            let half = norm(along) / 2.0;
            let across = size.first().copied().unwrap_or_default();
            size = match kind.as_str() {
                "capsule" | "cylinder" => vec![across, half],
                _ => vec![across, across, half],
            };
        }
        let at = |k: usize| size.get(k).copied().unwrap_or(0.0);
        let Some((volume, radii)) = solid(&kind, [at(0), at(1), at(2)]) else {
            let message = format!("geoms of type '{kind}' have no inertia here");
            let hint = "give the body an <inertial>, or the geom mass=\"0\"";
            self.fields.log.error(of.element.place, message, hint);
            return nothing;
        };
        let mass = mass.unwrap_or(density * volume);
        let [x, y, z] = radii.map(|r| r * mass);
        Geom::Solid(pose, mass, [x, 0.0, 0.0, y, 0.0, z])
    }
}

/// What a geom adds to the inertia of its body.
enum Geom {
    /// The name of the mesh; `None` for a shape that is fitted to one.
    Mesh(Option<String>),
    /// Frame at the centre of mass, mass, moments of inertia.
    Solid(Pose, f64, [f64; 6]),
}

/// The volume, and the principal moments of inertia per unit of mass about the centre; `a`, `b` and
/// `c` are the sizes in MuJoCo's order (half lengths). `None` for other shapes.
fn solid(kind: &str, [a, b, c]: V3) -> Option<(f64, V3)> {
    let ellipsoid = |[a, b, c]: V3| {
        let moment = |p: f64, q: f64| (p * p + q * q) / 5.0;
        (
            4.0 / 3.0 * PI * a * b * c,
            [moment(b, c), moment(a, c), moment(a, b)],
        )
    };
    let tube = |r: f64, l: f64| ((3.0 * r * r + l * l) / 12.0, r * r / 2.0);
    match kind {
        "sphere" => Some(ellipsoid([a, a, a])),
        "ellipsoid" => Some(ellipsoid([a, b, c])),
        "box" => {
            let moment = |p: f64, q: f64| (p * p + q * q) / 3.0;
            let moments = [moment(b, c), moment(a, c), moment(a, b)];
            Some((8.0 * a * b * c, moments))
        }
        "cylinder" => {
            let (across, along) = tube(a, 2.0 * b);
            Some((2.0 * PI * a * a * b, [across, across, along]))
        }
        "capsule" => {
            let l = 2.0 * b;
            let (middle, ends) = (PI * a * a * l, 4.0 / 3.0 * PI * a * a * a);
            let volume = middle + ends;
            let (across, along) = tube(a, l);
            // half spheres: their centres of mass are 3/8 of the radius from the flat sides
            let end = 0.4 * a * a + l * l / 4.0 + 3.0 / 8.0 * l * a;
            let across = (middle * across + ends * end) / volume;
            let along = (middle * along + ends * 0.4 * a * a) / volume;
            Some((volume, [across, across, along]))
        }
        _ => None,
    }
}

/// The combined inertia of several solids, in the frame in which they are placed.
fn combined(parts: &[(Pose, f64, [f64; 6])]) -> Option<Inertia> {
    let mass: f64 = parts.iter().map(|p| p.1).sum();
    if mass <= 0.0 {
        return None;
    }
    let weighted = parts.iter().map(|(pose, m, _)| scaled(pose.p, m / mass));
    let com = weighted.fold([0.0; 3], sum);
    let mut tensor = [0.0; 6];
    for (pose, m, own) in parts {
        let turned = tensor_in(*own, &transposed(&pose.r));
        let [u, v, w] = difference(pose.p, com);
        let steiner = [
            v * v + w * w,
            -u * v,
            -u * w,
            u * u + w * w,
            -v * w,
            u * u + v * v,
        ];
        for ((entry, own), moved) in tensor.iter_mut().zip(turned).zip(steiner) {
            *entry += own + m * moved;
        }
    }
    let com = crate::pose::clean(com, norm(com));
    let largest = tensor.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let tensor = tensor.map(|x| crate::number::rounded(x, largest, crate::pose::INERTIA_DIGITS));
    Some(Inertia { mass, com, tensor })
}
