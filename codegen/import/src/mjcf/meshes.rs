//! The solids that meshes of the file bound.

use super::Reading;
use super::orientation::Classed;
use crate::mesh::{Solid, bounded, solid};
use crate::xml::Element;

impl Reading<'_, '_, '_> {
    /// The solid of a mesh by its name; in words why it has none.
    pub(super) fn mesh(&mut self, name: &str) -> Result<Solid, String> {
        if let Some(found) = self.solids.get(name) {
            return found.clone();
        }
        let found = self.read_mesh(name);
        self.solids.insert(name.to_owned(), found.clone());
        found
    }

    fn read_mesh(&mut self, name: &str) -> Result<Solid, String> {
        let root = self.root;
        let mut meshes = root.all("asset").flat_map(|asset| asset.all("mesh"));
        let element = meshes.find(|mesh| is_called(mesh, name));
        let element = element.ok_or_else(|| format!("no mesh is called '{name}'"))?;
        let of = Classed {
            element,
            inherited: None,
        };
        if ["refpos", "refquat"]
            .iter()
            .any(|a| self.attribute(of, a).is_some())
        {
            return Err(format!("the mesh '{name}' has a frame of its own"));
        }
        let factors = self.attribute(of, "scale");
        let factors = factors
            .and_then(|a| self.fields.array::<3>(&a))
            .unwrap_or([1.0; 3]);
        let found = match (element.text("file"), element.attribute("face")) {
            (Some(file), _) => {
                let path = self.compiler.mesh_path(file);
                let bytes = (self.files)(&path).map_err(|why| format!("'{path}': {why}"))?;
                solid(&path, &bytes, factors)
            }
            (None, Some(faces)) => {
                let corners = element.attribute("vertex");
                let corners = corners
                    .and_then(|a| self.fields.numbers(a))
                    .unwrap_or_default();
                let (corners, _) = corners.as_chunks::<3>();
                let at = |word: &str| corners.get(word.parse::<usize>().ok()?).copied();
                let words: Vec<&str> = faces.value.split_whitespace().collect();
                let (faces, _) = words.as_chunks::<3>();
                let triangles = faces.iter().map(|[a, b, c]| Some([at(a)?, at(b)?, at(c)?]));
                match triangles.collect::<Option<Vec<_>>>() {
                    Some(triangles) => bounded(&triangles, factors),
                    None => Err("its triangles cannot be read"),
                }
            }
            (None, None) => Err("the hull of points is not computed"),
        };
        found.map_err(|why| format!("mesh '{name}': {why}"))
    }
}

/// Whether a mesh has a name; without one it has that of its file.
fn is_called(mesh: &Element, name: &str) -> bool {
    match (mesh.text("name"), mesh.text("file")) {
        (Some(own), _) => own == name,
        (None, Some(file)) => {
            let file = file.rsplit(['/', '\\']).next().unwrap_or(file);
            file.rsplit_once('.').map_or(file, |(stem, _)| stem) == name
        }
        (None, None) => false,
    }
}
