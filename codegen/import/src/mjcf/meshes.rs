//! The solids that meshes of the file bound.

use super::Reading;
use super::orientation::Classed;
use crate::mesh::{Solid, Volume, solid, triangles};
use crate::xml::Element;

impl Reading<'_, '_, '_> {
    /// The solid of a mesh by its name; the error says why there is none.
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
        let volume = match self
            .attribute(of, "inertia")
            .as_ref()
            .map(|a| a.value.as_str())
        {
            Some("exact") => Volume::Exact,
            None if self.compiler.exact_meshes => Volume::Exact,
            None | Some("legacy") => Volume::EachTriangle,
            Some("shell") => return Err("shells are not computed".to_owned()),
            Some(_) => return Err(format!("the hull of the mesh '{name}' is not computed")),
        };
        let found = match (element.text("file"), element.attribute("face")) {
            (Some(file), _) => {
                let path = self.compiler.mesh_path(file);
                let bytes = (self.files)(&path).map_err(|why| format!("'{path}': {why}"))?;
                triangles(&path, &bytes)
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
                let faces = faces.iter().map(|[a, b, c]| Some([at(a)?, at(b)?, at(c)?]));
                let faces: Option<Vec<_>> = faces.collect();
                faces.ok_or("its triangles cannot be read")
            }
            (None, None) => Err("the hull of points is not computed"),
        };
        let found = found.and_then(|triangles| solid(&triangles, factors, volume));
        found.map_err(|why| format!("mesh '{name}': {why}"))
    }
}

/// Whether a mesh has this name; a mesh without a name has that of its file, without extension.
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
