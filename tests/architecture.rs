//! The rules of the layout that a compiler does not check: arrows point one way, and the firmware's main file stays short.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree, Visibility};

/// Lines of `src/main.rs` at most.
const MAIN_LINES: usize = 400;

/// Where the code lies.
const SOURCES: [&str; 10] = [
    "src",
    "quantities/src",
    "inertial/src",
    "calibration/src",
    "hal-sim/src",
    "simulated/src",
    "page/src",
    "learn/src",
    "cli/src",
    "proofs/src",
];

/// A module, or a name in one, from the crate's root: `fix::dwell` is `["fix", "dwell"]`.
type ModulePath = Vec<String>;
/// Which module uses which, among those of one folder.
type Uses = BTreeMap<String, BTreeSet<String>>;

/// A file's module.
#[derive(Default)]
struct Module {
    /// What its code names by `crate`, `super` or `self`, as it is written.
    paths: Vec<ModulePath>,
    /// What it exports under another path: the name, and what it stands for.
    exports: Vec<(String, ModulePath)>,
}

impl Module {
    fn leaves(&mut self, tree: &UseTree, prefix: &mut ModulePath, exported: bool) {
        match tree {
            UseTree::Path(path) => {
                prefix.push(path.ident.to_string());
                self.leaves(&path.tree, prefix, exported);
                prefix.pop();
            }
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.leaves(tree, prefix, exported)),
            UseTree::Glob(_) => self.paths.push(prefix.clone()),
            UseTree::Name(syn::UseName { ident, .. }) | UseTree::Rename(syn::UseRename { ident, .. }) => {
                let leaf: ModulePath = prefix.iter().cloned().chain([ident.to_string()]).collect();
                let name = if let UseTree::Rename(rename) = tree { &rename.rename } else { ident };
                if exported {
                    self.exports.push((name.to_string(), leaf.clone()));
                }
                self.paths.push(leaf);
            }
        }
    }
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Path>().is_ok_and(|cfg| cfg.is_ident("test"))
    })
}

impl<'ast> Visit<'ast> for Module {
    fn visit_item(&mut self, item: &'ast Item) {
        match item {
            Item::Mod(module) if is_test(&module.attrs) => {}
            Item::Use(item) if is_test(&item.attrs) => {}
            Item::Use(item) => {
                let exported = !matches!(item.vis, Visibility::Inherited);
                self.leaves(&item.tree, &mut Vec::new(), exported);
            }
            _ => visit::visit_item(self, item),
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.paths.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }
}

/// The modules below a folder, but for those of tests.
fn read(folder: &Path, at: &ModulePath, modules: &mut BTreeMap<ModulePath, Module>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let below = at.iter().cloned().chain([name.clone()]).collect();
        if path.is_dir() {
            read(&path, &below, modules);
        } else if path.extension().is_some_and(|extension| extension == "rs") && name != "tests" {
            let file = syn::parse_file(&fs::read_to_string(&path).unwrap()).unwrap();
            let module = if matches!(name.as_str(), "mod" | "lib" | "main") { at.clone() } else { below };
            modules.entry(module).or_default().visit_file(&file);
        }
    }
}

/// What a path that is written in a module stands for, from the crate's root; `None`: it is of another crate.
fn absolute(module: &[String], written: &[String], modules: &BTreeMap<ModulePath, Module>) -> Option<ModulePath> {
    let (first, rest) = written.split_first()?;
    match first.as_str() {
        "crate" => Some(rest.to_vec()),
        "self" => Some([module, rest].concat()),
        "super" => {
            let (_, parent) = module.split_last()?;
            let supers = rest.iter().take_while(|segment| *segment == "super").count();
            Some([&parent[..parent.len().checked_sub(supers)?], &rest[supers..]].concat())
        }
        _ => {
            let child = [module, std::slice::from_ref(first)].concat();
            modules.contains_key(&child).then(|| [module, written].concat())
        }
    }
}

/// The module in which something is: through what others export; `None`: in another crate.
fn home(path: &[String], modules: &BTreeMap<ModulePath, Module>, depth: u8) -> Option<ModulePath> {
    let known = (0..=path.len()).rev().find(|&length| modules.contains_key(&path[..length])).unwrap_or_default();
    let (module, rest) = path.split_at(known);
    let exports = modules.get(module).map(|module| module.exports.as_slice()).unwrap_or_default();
    let exported = exports.iter().find(|(name, _)| rest.first() == Some(name) && depth < 8);
    match exported {
        Some((_, written)) => home(&absolute(module, written, modules)?, modules, depth + 1),
        None => Some(module.to_vec()),
    }
}

/// What a folder's own file is called among the modules of the folder.
const OWN: &str = "mod";

/// Of every folder, which of its modules use which. The folder's own file is one of them.
fn folders(modules: &BTreeMap<ModulePath, Module>) -> BTreeMap<ModulePath, Uses> {
    let mut folders: BTreeMap<ModulePath, Uses> = BTreeMap::new();
    for (user, module) in modules {
        for used in module.paths.iter().filter_map(|written| absolute(user, written, modules)) {
            let Some(used) = home(&used, modules, 0) else { continue };
            let common = user.iter().zip(&used).take_while(|(a, b)| a == b).count();
            let part = |path: &ModulePath| path.get(common).map_or(OWN, String::as_str).to_owned();
            let (user_part, used_part) = (part(user), part(&used));
            if user_part != used_part {
                folders.entry(user[..common].to_vec()).or_default().entry(user_part).or_default().insert(used_part);
            }
        }
    }
    folders
}

/// A way from a module back to itself.
fn cycle(uses: &Uses) -> Option<Vec<&str>> {
    fn back<'a>(uses: &'a Uses, way: &mut Vec<&'a str>, seen: &mut BTreeSet<&'a str>) -> bool {
        let last = way[way.len() - 1];
        for next in uses.get(last).into_iter().flatten() {
            if *next == way[0] {
                way.push(next);
                return true;
            }
            if seen.insert(next) {
                way.push(next);
                if back(uses, way, seen) {
                    return true;
                }
                way.pop();
            }
        }
        false
    }
    uses.keys().find_map(|first| {
        let mut way = vec![first.as_str()];
        back(uses, &mut way, &mut BTreeSet::new()).then_some(way)
    })
}

/// Folders whose own file declares what their modules share, and composes them as well: a circle inside one folder. No other is to join them.
const SHARED_IN_OWN_FILE: [&str; 36] = [
    "calibration/src/ellipsoid",
    "calibration/src/field",
    "calibration/src/six_position",
    "cli/src/campaign",
    "cli/src/commands",
    "cli/src/commands/calibrate",
    "cli/src/commands/doctor",
    "cli/src/dashboard",
    "cli/src/diagnose",
    "cli/src/engine",
    "cli/src/engine/qemu",
    "cli/src/import",
    "cli/src/import/map",
    "cli/src/recorder",
    "cli/src/run_data",
    "hal-sim/src/",
    "hal-sim/src/scenario",
    "hal-sim/src/triad",
    "inertial/src/alignment",
    "inertial/src/filter",
    "inertial/src/hold",
    "proofs/src/composed",
    "proofs/src/faults",
    "proofs/src/hidden",
    "proofs/src/hidden/outside",
    "proofs/src/judge",
    "src/board",
    "src/board/f405",
    "src/board/mps2",
    "src/effects",
    "src/effects/basis",
    "src/fix",
    "src/instrument",
    "src/instrument/replay",
    "src/sensing/frame",
    "src/settings",
];

#[test]
fn modules_form_no_cycle() {
    let (mut cycles, mut shared) = (Vec::new(), Vec::new());
    for source in SOURCES {
        let mut modules = BTreeMap::new();
        read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(source), &Vec::new(), &mut modules);
        for (folder, uses) in folders(&modules) {
            let place = format!("{source}/{}", folder.join("/"));
            let apart: Uses = uses
                .iter()
                .filter(|(user, _)| *user != OWN)
                .map(|(user, used)| (user.clone(), used.iter().filter(|used| *used != OWN).cloned().collect()))
                .collect();
            if let Some(way) = cycle(&apart) {
                cycles.push(format!("{place}: {}", way.join(" -> ")));
            } else if cycle(&uses).is_some() {
                shared.push(place);
            }
        }
    }
    assert!(cycles.is_empty(), "{}", cycles.join("\n"));
    let new: Vec<String> = shared.into_iter().filter(|place| !SHARED_IN_OWN_FILE.contains(&place.as_str())).collect();
    assert!(new.is_empty(), "a folder's own file and its modules use each other: {}", new.join(", "));
}

/// The parser and the search of cycles see what they must: a cycle through a name that the parent exports.
#[test]
fn a_cycle_is_found() {
    let mut modules: BTreeMap<ModulePath, Module> = BTreeMap::new();
    for (module, text) in [
        ("", "mod a; mod b; mod c; pub use b::deep::{Thing as Renamed};"),
        ("a", "use super::Renamed; #[cfg(test)] mod tests { use crate::c::Other; }"),
        ("b", "pub mod deep;"),
        ("b::deep", "pub struct Thing; fn f() { crate::c::g(); }"),
        ("c", "/* use crate::a::X; */ fn g() { let _ = crate::a::h; }"),
    ] {
        let path = module.split("::").filter(|part| !part.is_empty()).map(str::to_owned).collect();
        modules.entry(path).or_default().visit_file(&syn::parse_file(text).unwrap());
    }
    let folders = folders(&modules);
    assert_eq!(cycle(&folders[&Vec::new()]), Some(vec!["a", "b", "c", "a"]));
}

#[test]
fn the_main_file_is_short() {
    let lines = include_str!("../src/main.rs").lines().count();
    assert!(lines <= MAIN_LINES, "src/main.rs has {lines} lines, {MAIN_LINES} at most");
}

/// Modules of the core that its users see, in the order of use.
const PUBLIC_MODULES: usize = 10;

#[test]
fn the_core_has_few_public_modules() {
    let modules = include_str!("../src/lib.rs").lines().filter(|line| line.starts_with("pub mod ")).count();
    assert!(modules <= PUBLIC_MODULES, "src/lib.rs has {modules} public modules, {PUBLIC_MODULES} at most");
}
