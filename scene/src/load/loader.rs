//! The scene under construction, and what all readers share: each OBJ is read once a material that is put on it, each
//! picture once a use.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{UVec2, Vec3};

use super::error::{LoadError, Place, quoted};
use super::files::Files;
use super::mtl::{self, At, MtlMaterial};
use super::obj::{self, Obj};
use super::picture::{self, Pixels};
use super::polygon::Cutter;
use super::warnings::Warnings;
use super::{FileSettings, Loaded, limits, mtl_meaning};
use crate::description::{Description, Material, Mesh, SpecularKind};
use crate::{Environment, Texture};

/// What a texture is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Use {
    /// Diffuse colour.
    Color,
    /// Emission, which may be above 1.
    Emission,
    /// Opacity.
    Mask,
}

/// Collects a [`Description`].
pub(super) struct Loader<'a> {
    pub(super) files: Files<'a>,
    pub(super) description: Description,
    pub(super) warnings: Warnings,
    pub(super) cutter: Cutter,
    textures: HashMap<(PathBuf, Use), u32>,
    /// Where the meshes of OBJ files are in the description, as they were read: they are moved when no other needs
    /// them.
    objs: HashMap<(PathBuf, Option<u32>), usize>,
    triangles: usize,
    copies: u64,
    default_material: Option<u32>,
}

/// Materials by name, each with the library it is from.
type Library = HashMap<String, (PathBuf, MtlMaterial)>;

impl<'a> Loader<'a> {
    pub(super) fn new(files: Files<'a>) -> Self {
        Self {
            files,
            description: Description::default(),
            warnings: Warnings::default(),
            cutter: Cutter::default(),
            textures: HashMap::new(),
            objs: HashMap::new(),
            triangles: 0,
            copies: 0,
            default_material: None,
        }
    }

    /// Makes dark what shines by a picture that is black, as exporters write it for materials that do not shine.
    fn put_out_black_pictures(&mut self) {
        let Description { textures, materials, .. } = &mut self.description;
        let pictures = self.textures.iter().filter(|((_, usage), _)| *usage == Use::Emission).map(|(_, &index)| index);
        let black: HashSet<u32> = pictures.filter(|&index| textures[index as usize].is_black()).collect();
        for material in materials {
            if material.emission_texture.is_some_and(|texture| black.contains(&texture)) {
                (material.emission, material.emission_texture) = (Vec3::ZERO, None);
            }
        }
    }

    /// Ends the work: a scene without light gets a sky, and the surroundings are scaled.
    pub(super) fn finish(
        mut self,
        settings: FileSettings,
        environment_scale: f32,
        place: Place<'_>,
    ) -> Result<Loaded, LoadError> {
        self.put_out_black_pictures();
        let shining: Vec<bool> = self.description.materials.iter().map(Material::is_emissive).collect();
        let description = &mut self.description;
        let is_lit = description.environment.is_some()
            || !description.lights.is_empty()
            || description.forms.iter().any(|form| shining[form.material as usize])
            || description.meshes.iter().flat_map(|mesh| &mesh.materials).any(|&material| shining[material as usize]);
        if !is_lit {
            description.environment = Some(Environment::sky());
        }
        if let Some(environment) = description.environment.take() {
            description.environment = Some(scaled(environment, environment_scale, place)?);
        }
        Ok(Loaded { description: self.description, settings, warnings: self.warnings.into_lines(), files: Vec::new() })
    }

    /// Adds a material; returns its index.
    pub(super) fn add_material(&mut self, material: Material, place: Place<'_>) -> Result<u32, LoadError> {
        let count = self.description.materials.len();
        if count >= limits::MATERIALS {
            return Err(place.too_large(format!("more than {} materials", limits::MATERIALS), "use fewer"));
        }
        self.description.materials.push(material);
        Ok(as_u32(count))
    }

    /// The grey of surfaces without a material.
    pub(super) fn default_material(&mut self, place: Place<'_>) -> Result<u32, LoadError> {
        if let Some(index) = self.default_material {
            return Ok(index);
        }
        let index = self.add_material(Material { name: "default".to_owned(), ..Material::default() }, place)?;
        self.default_material = Some(index);
        Ok(index)
    }

    /// Adds a mesh whose materials point into the description; returns its index.
    pub(super) fn add_mesh(&mut self, mesh: Mesh, place: Place<'_>) -> Result<usize, LoadError> {
        self.count_triangles(mesh.triangles.len(), place)?;
        self.description.meshes.push(mesh);
        Ok(self.description.meshes.len() - 1)
    }

    /// Counts triangles that are about to be added.
    fn count_triangles(&mut self, count: usize, place: Place<'_>) -> Result<(), LoadError> {
        self.triangles += count;
        if self.triangles > limits::TRIANGLES {
            return Err(place.too_large(format!("more than {} triangles", limits::TRIANGLES), "use coarser meshes"));
        }
        Ok(())
    }

    /// Counts copies of free forms that are about to be made.
    pub(super) fn count_copies(&mut self, count: u64, place: Place<'_>) -> Result<(), LoadError> {
        self.copies = self.copies.saturating_add(count);
        if self.copies > limits::COPIES {
            let what = format!("{} copies of free forms, more than the limit of {}", self.copies, limits::COPIES);
            return Err(place.too_large(what, "lower a count"));
        }
        Ok(())
    }

    /// Reads a texture once for each use; returns its index.
    pub(super) fn texture(&mut self, path: &Path, usage: Use, place: Place<'_>) -> Result<u32, LoadError> {
        let key = (self.files.identity(path), usage);
        if let Some(&index) = self.textures.get(&key) {
            return Ok(index);
        }
        let (UVec2 { x: width, y: height }, pixels) = picture::read(self.files, path, place, &mut self.warnings)?;
        let texture = match (pixels, usage) {
            // A picture with transparent parts is a mask by its transparency.
            (Pixels::Coded(_, Some(alpha)), Use::Mask) if alpha.iter().any(|&alpha| alpha < 255) => {
                Texture::from_srgb8(width, height, alpha.into_iter().map(|alpha| [alpha; 3]).collect())
            }
            (Pixels::Coded(codes, _), _) => Texture::from_srgb8(width, height, codes),
            (Pixels::Linear(_, Some(alpha)), Use::Mask) if alpha.iter().any(|&alpha| alpha < 1.0) => {
                // What is no number, as NaN, is not there.
                let pixel = |alpha: f32| Vec3::splat(if alpha > 0.0 { alpha.min(1.0) } else { 0.0 });
                Texture::from_linear(width, height, alpha.into_iter().map(pixel).collect())
            }
            (Pixels::Linear(pixels, _), Use::Emission) => Texture::from_linear(width, height, pixels),
            (Pixels::Linear(mut pixels, _), _) => {
                let bright = pixels.iter().filter(|pixel| pixel.max_element() > 1.0).count();
                self.warnings.add_times(format!("{}: texture values above 1 taken as 1", Place::file(path)), bright);
                pixels.iter_mut().for_each(|pixel| *pixel = pixel.min(Vec3::ONE));
                Texture::from_linear(width, height, pixels)
            }
        };
        let index = as_u32(self.description.textures.len());
        self.description.textures.push(texture);
        self.textures.insert(key, index);
        Ok(index)
    }

    /// Reads the surroundings.
    pub(super) fn environment(
        &mut self,
        files: Files<'_>,
        path: &Path,
        place: Place<'_>,
    ) -> Result<Environment, LoadError> {
        let (UVec2 { x: width, y: height }, pixels) = picture::read(files, path, place, &mut self.warnings)?;
        match pixels {
            Pixels::Linear(pixels, _) => Ok(Environment::from_pixels(width, height, pixels)),
            Pixels::Coded(..) => {
                Err(Place::file(path).unsupported("an 8-bit picture as surroundings", "give an EXR or HDR picture"))
            }
        }
    }

    /// Adds the mesh of an OBJ with the materials that its faces use, or with one `material` for all; returns its
    /// index. It is not to be changed before all files are read, for it is copied where its file is named again.
    pub(super) fn add_obj(&mut self, path: &Path, material: Option<u32>, place: Place<'_>) -> Result<usize, LoadError> {
        let key = (self.files.identity(path), material);
        if let Some(&index) = self.objs.get(&key) {
            // A small file may name a large one often: the limit comes before the copy.
            self.count_triangles(self.description.meshes[index].triangles.len(), place)?;
            let copy = self.description.meshes[index].clone();
            self.description.meshes.push(copy);
            return Ok(self.description.meshes.len() - 1);
        }
        let Obj { mut mesh, names, libraries } =
            obj::read(self.files, path, place, &mut self.cutter, &mut self.warnings)?;
        if let Some(material) = material {
            mesh.materials.fill(material);
        } else {
            let library = self.libraries(path, &libraries)?;
            let mut indices: BTreeMap<u32, u32> = mesh.materials.iter().map(|&name| (name, 0)).collect();
            for (&name, index) in &mut indices {
                *index = self.named_material(&names[name as usize], &library, path)?;
            }
            mesh.materials.iter_mut().for_each(|material| *material = indices[material]);
        }
        let index = self.add_mesh(mesh, place)?;
        self.objs.insert(key, index);
        Ok(index)
    }

    /// The material that `usemtl name` in the OBJ `path` means.
    fn named_material(&mut self, name: &str, library: &Library, path: &Path) -> Result<u32, LoadError> {
        let file = Place::file(path);
        let Some((mtl_path, mtl)) = library.get(name) else {
            if !name.is_empty() {
                self.warnings.add(format!("{file}: material {} is in no library, grey is taken", quoted(name)));
            }
            return self.default_material(file);
        };
        let mut material = mtl_meaning::translate(mtl, mtl_path, &mut self.warnings)?;
        // Glass has neither a diffuse part nor holes, metal no diffuse part: a picture that nothing would show may be
        // missing.
        let transmits = matches!(material.specular, SpecularKind::Dielectric { .. });
        let is_metal = mtl.metalness == Some(1.0);
        if let Some(map) = mtl.diffuse_map.as_ref().filter(|_| !transmits && !is_metal) {
            material.diffuse_texture = Some(self.picture(mtl_path, map, Use::Color)?);
        }
        let reflects = matches!(material.specular, SpecularKind::Ggx { .. } | SpecularKind::Mirror { .. });
        let reflectance_map = mtl_meaning::reflectance_map(mtl);
        if let Some(map) = reflectance_map.filter(|_| reflects) {
            material.specular_texture = Some(self.picture(mtl_path, map, Use::Color)?);
        }
        let is_unused = is_metal && !transmits && reflectance_map != mtl.diffuse_map.as_ref();
        if let Some(map) = mtl.diffuse_map.as_ref().filter(|_| is_unused) {
            let place = Place::line(mtl_path, map.line);
            self.warnings.add(format!("{place}: map_Kd is not used, as the metal has the colour of Ks"));
        }
        if let (Some(map), Some(Vec3::ZERO), false) = (&mtl.specular_map, mtl.specular, transmits) {
            let place = Place::line(mtl_path, map.line);
            self.warnings.add(format!("{place}: map_Ks is multiplied by Ks, which is 0"));
        }
        match &mtl.emission_map {
            Some(map) if material.is_emissive() => {
                material.emission_texture = Some(self.picture(mtl_path, map, Use::Emission)?);
            }
            Some(map) => {
                let place = Place::line(mtl_path, map.line);
                self.warnings.add(format!("{place}: map_Ke is multiplied by Ke, which is 0"));
            }
            None => {}
        }
        if let Some(map) = mtl.dissolve_map.as_ref().filter(|_| !transmits) {
            material.opacity_texture = Some(self.picture(mtl_path, map, Use::Mask)?);
        }
        self.add_material(material, file)
    }

    /// The picture that a library names.
    fn picture(&mut self, mtl_path: &Path, map: &At<String>, usage: Use) -> Result<u32, LoadError> {
        let path = self.files.resolve(mtl_path, &map.value);
        self.texture(&path, usage, Place::line(mtl_path, map.line))
    }

    /// Reads the libraries of the OBJ `path`, each once; of two materials of one name the last wins.
    fn libraries(&mut self, path: &Path, arguments: &[(String, usize)]) -> Result<Library, LoadError> {
        let mut library = Library::new();
        let mut seen = HashSet::new();
        for (argument, line) in arguments {
            let place = Place::line(path, *line);
            for name in self.library_names(path, argument) {
                let file = self.files.resolve(path, &name);
                if !seen.insert(self.files.identity(&file)) {
                    continue;
                }
                if seen.len() > limits::INCLUDES {
                    return Err(
                        place.too_large(format!("more than {} material libraries", limits::INCLUDES), "join them")
                    );
                }
                if !self.files.exists(&file) {
                    self.warnings.add(format!("{place}: material library {} not found", quoted(&name)));
                    continue;
                }
                for material in mtl::read(self.files, &file, place, &mut self.warnings)? {
                    if library.contains_key(&material.name) {
                        let what = format!(
                            "{}: material defined twice, the last is taken: {}",
                            Place::file(&file),
                            quoted(&material.name)
                        );
                        self.warnings.add(what);
                    }
                    library.insert(material.name.clone(), (file.clone(), material));
                }
            }
        }
        Ok(library)
    }

    /// File names in an argument of `mtllib`: all of it where there is such a file, else its words; `\ ` is a blank in
    /// a word.
    fn library_names(&self, path: &Path, argument: &str) -> Vec<String> {
        if self.files.exists(&self.files.resolve(path, argument)) {
            return vec![argument.to_owned()];
        }
        const BLANK: &str = "\u{1}";
        let marked = argument.replace("\\ ", BLANK);
        marked.split_ascii_whitespace().map(|word| word.replace(BLANK, " ")).collect()
    }
}

/// The environment times `factor`, which must leave it finite.
pub(super) fn scaled(environment: Environment, factor: f32, place: Place<'_>) -> Result<Environment, LoadError> {
    if !(factor.is_finite() && factor >= 0.0) {
        let what = format!("the scale of the environment is {factor}");
        return Err(place.invalid(what, "give a finite number of at least 0"));
    }
    let environment = environment.scaled(factor);
    if environment.pixels.iter().all(|pixel| pixel.is_finite()) {
        return Ok(environment);
    }
    Err(place.invalid(format!("the environment times {factor} is not finite"), "give a smaller scale"))
}

/// An index within the limits as the description holds it.
pub(super) fn as_u32(index: usize) -> u32 {
    u32::try_from(index).expect("counts are limited to less than 2^32")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_of_an_obj_count_before_they_are_made() {
        let files = [("a.obj", &b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"[..])];
        let mut loader = Loader::new(Files::Embedded(&files));
        let (path, place) = (Path::new("a.obj"), Place::line(Path::new("a.toml"), 3));
        loader.triangles = limits::TRIANGLES - 2;
        assert_eq!(
            (loader.add_obj(path, None, place), loader.add_obj(path, None, place)),
            (Ok(0), Ok(1)),
            "up to the limit"
        );
        let error = loader.add_obj(path, None, place).unwrap_err().to_string();
        assert!(error.starts_with("a.toml:3: more than 268435456 triangles"), "{error}");
        assert_eq!(loader.description.meshes.len(), 2, "nothing was copied");
    }
}
