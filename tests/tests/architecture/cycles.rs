//! Circles in what needs what.

use crate::source::Crate;
use std::collections::{BTreeMap, BTreeSet};

/// From → to → the imports that say so.
type Graph = BTreeMap<String, BTreeMap<String, BTreeSet<String>>>;

/// An import from one file of a crate into another that is not of the importing module's own children.
struct Import {
    from: usize,
    to: usize,
    text: String,
    rooted: bool,
}

/// Imports between files. Names that an import brought along are left out where the import itself leads to the same file.
fn imports(read: &Crate) -> Vec<Import> {
    let mut found = Vec::new();
    for (index, module) in read.modules.iter().enumerate() {
        for mention in &module.mentions {
            let Some(to) = read.defining_file(index, &mention.path) else { continue };
            let own = &read.files[module.file].module;
            if to != module.file && !read.files[to].module.starts_with(own) {
                let file = read.files[module.file].path.display();
                let text = format!("{file}:{}: {}", mention.line, mention.path.join("::"));
                let rooted = ["crate", "self", "super"].contains(&mention.path[0].as_str());
                found.push(Import { from: module.file, to, text, rooted });
            }
        }
    }
    let rooted: BTreeSet<(usize, usize)> = found.iter().filter(|i| i.rooted).map(|i| (i.from, i.to)).collect();
    found.retain(|i| i.rooted || !rooted.contains(&(i.from, i.to)));
    found
}

/// Files that need each other.
pub(crate) fn between_files(read: &Crate) -> Vec<String> {
    let mut graph = Graph::new();
    for import in imports(read) {
        let name = |file: usize| read.files[file].path.display().to_string();
        add(&mut graph, name(import.from), name(import.to), import.text);
    }
    circles(&read.name, &graph)
}

/// Modules of one level, files and folders alike, that need each other by what is in them.
pub(crate) fn between_siblings(read: &Crate) -> Vec<String> {
    let mut levels: BTreeMap<Vec<String>, Graph> = BTreeMap::new();
    for import in imports(read) {
        let (from, to) = (&read.files[import.from].module, &read.files[import.to].module);
        let shared = from.iter().zip(to).take_while(|(a, b)| a == b).count();
        if shared < from.len() && shared < to.len() {
            let graph = levels.entry(from[..shared].to_vec()).or_default();
            add(graph, from[..=shared].join("::"), to[..=shared].join("::"), import.text);
        }
    }
    levels.values().flat_map(|graph| circles(&read.name, graph)).collect()
}

/// Imports of the crate's own modules from groups that come later than the importing one's.
pub(crate) fn against_order(read: &Crate, groups: &[Vec<String>]) -> Vec<String> {
    let group = |module: &[String]| {
        let room = module.first()?;
        groups.iter().position(|group| group.contains(room))
    };
    let up = |import: &Import| {
        let [from, to] = [import.from, import.to].map(|file| group(&read.files[file].module));
        from.zip(to).is_some_and(|(from, to)| from < to)
    };
    imports(read).into_iter().filter(up).map(|import| import.text).collect()
}

fn add(graph: &mut Graph, from: String, to: String, import: String) {
    graph.entry(from).or_default().entry(to).or_default().insert(import);
}

/// What can be reached from a place.
fn reached<'g>(graph: &'g Graph, from: &str) -> BTreeSet<&'g str> {
    let mut seen = BTreeSet::new();
    let mut open = vec![from];
    while let Some(place) = open.pop() {
        for next in graph.get(place).into_iter().flat_map(BTreeMap::keys) {
            if seen.insert(next.as_str()) {
                open.push(graph.get_key_value(next).map_or("", |(key, _)| key.as_str()));
            }
        }
    }
    seen
}

/// Each set of places that reach each other, with the imports between them.
fn circles(name: &str, graph: &Graph) -> Vec<String> {
    let reach: BTreeMap<&str, BTreeSet<&str>> = graph.keys().map(|k| (k.as_str(), reached(graph, k))).collect();
    let both = |a: &str, b: &str| {
        let reaches = |a: &str, b: &str| reach.get(a).is_some_and(|r| r.contains(b));
        reaches(a, b) && reaches(b, a)
    };
    let mut told = BTreeSet::new();
    let mut found = Vec::new();
    for start in graph.keys().filter(|k| both(k, k)) {
        if told.contains(start) {
            continue;
        }
        let members: Vec<&str> = graph.keys().filter(|k| both(start, k)).map(String::as_str).collect();
        told.extend(graph.keys().filter(|k| members.contains(&k.as_str())));
        found.push(format!("{name}: {}\n{}", members.join(" ↔ "), told_imports(graph, members)));
    }
    found
}

/// The fewest imports found that would open a circle, and all others where there are few.
fn told_imports(graph: &Graph, members: Vec<&str>) -> String {
    let order = least_running_back(graph, members);
    let place = |name: &str| order.iter().position(|m| *m == name);
    let edges: Vec<(&str, &str)> = order
        .iter()
        .flat_map(|from| graph[*from].keys().filter(|to| place(to).is_some()).map(move |to| (*from, to.as_str())))
        .collect();
    let (up, down): (Vec<_>, Vec<_>) = edges.iter().partition(|(from, to)| place(from) < place(to));
    let mut text = format!("    least to cut, with the order {}:\n", order.join(" "));
    for (from, to) in up.into_iter().chain(down.into_iter().filter(|_| edges.len() <= FEW)) {
        text += &format!("    {from} → {to}\n");
        for import in &graph[from][to] {
            text += &format!("        {import}\n");
        }
    }
    text
}

/// Circles of up to so many arrows are told whole.
const FEW: usize = 6;

/// An order of the members in which as few imports as can be found name something that comes later: the best of moving one
/// at a time.
fn least_running_back<'g>(graph: &Graph, mut order: Vec<&'g str>) -> Vec<&'g str> {
    let imports = |from: &str, to: &str| graph[from].get(to).map_or(0, BTreeSet::len);
    let cost = |order: &[&str]| -> usize {
        (0..order.len()).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| imports(order[j], order[i])).sum()
    };
    let mut least = cost(&order);
    loop {
        let before = least;
        for from in 0..order.len() {
            for to in 0..order.len() {
                let mut moved = order.clone();
                let member = moved.remove(from);
                moved.insert(to, member);
                let found = cost(&moved);
                if found < least {
                    (least, order) = (found, moved);
                }
            }
        }
        if least == before {
            return order;
        }
    }
}
