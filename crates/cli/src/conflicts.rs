//! Files that are written must be neither files that are read nor each other: told by what they are, not by their names.

use crate::args::RenderArgs;
use crate::stop::Stop;
use std::fs;
use std::path::{Path, PathBuf};

/// A file by what it is: where it lies on its device, or, where nothing lies yet, its folder and its name.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Identity {
    #[cfg(unix)]
    Node(u64, u64),
    Name(PathBuf),
}

impl Identity {
    /// `None` for devices and pipes, which many may write to.
    fn of(file: &Path) -> Option<Self> {
        match fs::metadata(file) {
            Ok(about) if !about.is_file() && !about.is_dir() => None,
            #[cfg(unix)]
            Ok(about) => {
                use std::os::unix::fs::MetadataExt;
                Some(Self::Node(about.dev(), about.ino()))
            }
            _ => Some(Self::Name(whole(file))),
        }
    }
}

/// A path from the root on, by what exists of it.
pub(crate) fn whole(file: &Path) -> PathBuf {
    if let Ok(whole) = fs::canonicalize(file) {
        return whole;
    }
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let folder = match fs::canonicalize(folder) {
        Ok(folder) => folder,
        Err(_) => std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()),
    };
    folder.join(file.file_name().unwrap_or_default())
}

/// What a command reads and writes, by the options that name it.
#[derive(Default)]
pub(crate) struct Files<'a> {
    pub(crate) read: Vec<(&'a str, PathBuf)>,
    pub(crate) written: Vec<(&'a str, PathBuf)>,
    /// Folders that files of these beginnings are written to.
    pub(crate) folders: Vec<(&'a str, PathBuf, &'a [&'a str])>,
}

impl Files<'_> {
    /// # Errors
    /// A file that is written is one that is read, or is written twice.
    pub(crate) fn check(&self) -> Result<(), Stop> {
        let identity = |file: &Path| Identity::of(file).filter(|_| file.as_os_str() != "-");
        for (i, (option, file)) in self.written.iter().enumerate() {
            let Some(id) = identity(file) else { continue };
            let is_same = |other: &&(&str, PathBuf)| identity(&other.1).as_ref() == Some(&id);
            let what = if let Some((other, file)) = self.read.iter().find(is_same) {
                format!("{} of {other}", file.display())
            } else if let Some((other, _)) = self.written[..i].iter().find(is_same) {
                format!("what {other} writes")
            } else if let Some(folder) = self.folder_of(file) {
                format!("a file that {folder} writes")
            } else {
                continue;
            };
            let file = file.display();
            return Err(Stop::bad(format!("{option} {file} would overwrite {what}")));
        }
        for (_, file) in &self.read {
            if let Some(folder) = identity(file).and_then(|_| self.folder_of(file)) {
                let file = file.display();
                return Err(Stop::bad(format!(
                    "{folder} may overwrite {file}, which is read"
                )));
            }
        }
        Ok(())
    }

    /// The option whose folder a file lies in, under a name that is written there.
    fn folder_of(&self, file: &Path) -> Option<&str> {
        let file = whole(file);
        let name = file.file_name()?.to_string_lossy().into_owned();
        let lies = |(_, folder, begins): &&(&str, PathBuf, &[&str])| {
            file.parent() == Some(&whole(folder)) && begins.iter().any(|b| name.starts_with(b))
        };
        self.folders.iter().find(lies).map(|(option, ..)| *option)
    }
}

/// For commands that read scenes and write files named by options: finds out whether these can be written.
///
/// # Errors
/// A file that is written is one that is read, or is written twice, or cannot be written.
pub(crate) fn of_files<'a>(
    scenes: &[String],
    read: impl IntoIterator<Item = (&'a str, PathBuf)>,
    written: impl IntoIterator<Item = (&'a str, Option<&'a PathBuf>)>,
) -> Result<(), Stop> {
    let written = written.into_iter();
    let written = written.filter_map(|(option, file)| Some((option, file?.clone())));
    let mut files = Files {
        read: read.into_iter().collect(),
        written: written.collect(),
        ..Files::default()
    };
    if files.written.is_empty() {
        return Ok(());
    }
    for scene in scenes {
        files.read.extend(of_scene(scene)?);
    }
    files.check()?;
    let mut written = files.written.iter();
    written.try_for_each(|(_, file)| output::check_writable(file).map_err(Stop::bad))
}

/// The files of a scene, as something that is read.
fn of_scene(spec: &str) -> Result<Vec<(&'static str, PathBuf)>, Stop> {
    let files = scene::files(spec)?.into_iter();
    Ok(files.map(|file| ("SCENE", file)).collect())
}

/// # Errors
/// `render` would overwrite what it reads or writes.
pub(crate) fn of_render(args: &RenderArgs) -> Result<(), Stop> {
    let single = [
        ("--stats", &args.stats),
        ("--timeline", &args.timeline),
        ("--rays-out", &args.rays_out),
        ("--video", &args.video),
        ("--y4m", &args.y4m),
    ];
    let single = single.into_iter();
    let images: &[&str] = &["frame_", "abvh-run"];
    let images = (!args.no_images).then(|| ("--out", args.out.clone(), images));
    let hits = args.hits.clone();
    let hits = hits.map(|dir| ("--hits", dir, &["hits_", "abvh-run"][..]));
    let files = Files {
        read: of_scene(&args.scene)?,
        written: single
            .filter_map(|(option, file)| Some((option, file.clone()?)))
            .collect(),
        folders: images.into_iter().chain(hits).collect(),
    };
    files.check()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_told_by_what_it_is_and_folders_keep_to_their_own_names() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        fs::write(at("in.obj"), b"v 0 0 0").unwrap();
        fs::create_dir(at("sub")).unwrap();
        fs::hard_link(at("in.obj"), at("hard")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("in.obj"), at("soft")).unwrap();
        let check = |read: &[&str], written: &[&str], folder: &str| {
            let files = Files {
                read: read.iter().map(|name| ("SCENE", at(name))).collect(),
                written: ["--stats", "--timeline"]
                    .into_iter()
                    .zip(written.iter().map(|name| at(name)))
                    .collect(),
                folders: vec![("--out", at(folder), &["frame_"])],
            };
            files
                .check()
                .map_or_else(|stop| stop.to_string(), |()| String::new())
        };
        for name in ["in.obj", "sub/../in.obj", "hard", "soft"] {
            assert!(
                check(&["in.obj"], &[name], "o").contains("of SCENE"),
                "{name}"
            );
        }
        assert!(check(&[], &["new", "sub/../new"], "o").contains("what --stats writes"));
        // Many may write to a device.
        assert_eq!(check(&[], &["/dev/null", "/dev/null"], "o"), "");
        for (name, folder, is_fit) in [
            ("frame_0000.png", ".", false),
            ("o/frame_0000.png", "o", false),
            ("o/stats.json", "o", true),
            ("frame_0000.png", "o", true),
        ] {
            assert_eq!(
                check(&[], &[name], folder).is_empty(),
                is_fit,
                "{name} {folder}"
            );
        }
        assert!(check(&["frame_1.obj"], &[], ".").contains("which is read"));
    }
}
