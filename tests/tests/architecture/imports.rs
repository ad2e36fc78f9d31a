//! The paths that a module's items mention, and the names that they declare.

use proc_macro2::{Span, TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, UseTree};

/// A path that stands in the source.
#[derive(Debug, Clone)]
pub(crate) struct Mention {
    pub(crate) path: Vec<String>,
    pub(crate) line: usize,
}

/// Whether an attribute keeps what it stands on to tests.
fn only_tests(attribute: &Attribute) -> bool {
    attribute.path().is_ident("cfg")
        && attribute.meta.require_list().is_ok_and(|list| {
            let condition = list.tokens.to_string();
            condition == "test" || condition.replace(' ', "").starts_with("all(test")
        })
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

/// Whether an item is there in tests only.
pub(crate) fn is_test(item: &Item) -> bool {
    attributes(item).iter().any(only_tests)
}

/// The name that an item declares.
pub(crate) fn declared(item: &Item) -> Option<String> {
    let ident = match item {
        Item::Const(i) => &i.ident,
        Item::Enum(i) => &i.ident,
        Item::Fn(i) => &i.sig.ident,
        Item::Macro(i) => i.ident.as_ref()?,
        Item::Static(i) => &i.ident,
        Item::Struct(i) => &i.ident,
        Item::Trait(i) => &i.ident,
        Item::Type(i) => &i.ident,
        Item::Union(i) => &i.ident,
        _ => return None,
    };
    Some(ident.to_string())
}

/// Names that a `use` brings, with their paths; no name for everything (`*`).
pub(crate) fn leaves(tree: &UseTree) -> Vec<(Option<String>, Vec<String>)> {
    let mut found = Vec::new();
    collect(tree, &mut Vec::new(), &mut |name, path, _| found.push((name, path.to_vec())));
    found
}

/// Told of every name that a `use` brings: the name, its path, where it stands.
type Leaf<'f> = dyn FnMut(Option<String>, &[String], Span) + 'f;

fn collect(tree: &UseTree, path: &mut Vec<String>, found: &mut Leaf<'_>) {
    match tree {
        UseTree::Path(next) => {
            path.push(next.ident.to_string());
            collect(&next.tree, path, found);
            path.pop();
        }
        UseTree::Group(group) => group.items.iter().for_each(|tree| collect(tree, path, found)),
        UseTree::Glob(glob) => found(None, path, glob.star_token.spans[0]),
        UseTree::Name(name) => leaf(&name.ident, &name.ident, path, found),
        UseTree::Rename(renamed) => leaf(&renamed.ident, &renamed.rename, path, found),
    }
}

fn leaf(ident: &syn::Ident, name: &syn::Ident, path: &[String], found: &mut Leaf<'_>) {
    if ident == "self" {
        let name = if name == "self" { path.last().cloned() } else { Some(name.to_string()) };
        found(name, path, ident.span());
    } else {
        found(Some(name.to_string()), &[path, &[ident.to_string()]].concat(), ident.span());
    }
}

/// Every path in a module's items, those of modules inside it left to them.
pub(crate) fn mentions(items: &[Item]) -> Vec<Mention> {
    let mut reader = Reader::default();
    items.iter().for_each(|item| reader.visit_item(item));
    reader.found
}

#[derive(Default)]
struct Reader {
    found: Vec<Mention>,
}

impl Reader {
    fn add(&mut self, path: Vec<String>, span: Span) {
        self.found.push(Mention { path, line: span.start().line });
    }

    /// Paths from `crate`, `self` or `super` in what a macro is given, and in the texts of attributes.
    fn read_tokens(&mut self, tokens: TokenStream) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Group(group) => self.read_tokens(group.stream()),
                TokenTree::Literal(literal) => self.read_text(&literal.to_string(), literal.span()),
                TokenTree::Ident(first) if ["crate", "self", "super"].iter().any(|word| first == word) => {
                    let path = idents(&tokens[at..]);
                    at += 3 * (path.len() - 1);
                    if path.len() > 1 {
                        self.add(path, first.span());
                    }
                }
                _ => {}
            }
            at += 1;
        }
    }

    fn read_text(&mut self, literal: &str, span: Span) {
        let text = literal.trim_matches('"');
        if (text.starts_with("crate::") || text.starts_with("super::")) && !text.contains(char::is_whitespace) {
            self.add(text.split("::").map(str::to_owned).collect(), span);
        }
    }
}

/// `a :: b :: c` at the start of some tokens.
fn idents(tokens: &[TokenTree]) -> Vec<String> {
    let is_colon = |t: Option<&TokenTree>| matches!(t, Some(TokenTree::Punct(p)) if p.as_char() == ':');
    let mut path = Vec::new();
    let mut at = 0;
    while let Some(TokenTree::Ident(ident)) = tokens.get(at) {
        path.push(ident.to_string());
        if !(is_colon(tokens.get(at + 1)) && is_colon(tokens.get(at + 2))) {
            break;
        }
        at += 3;
    }
    path
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast Item) {
        if !is_test(item) && !matches!(item, Item::Mod(_)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, import: &'ast syn::ItemUse) {
        collect(&import.tree, &mut Vec::new(), &mut |_, path, span| self.add(path.to_vec(), span));
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if let Some(first) = path.segments.first().filter(|_| path.segments.len() > 1) {
            self.add(path.segments.iter().map(|s| s.ident.to_string()).collect(), first.ident.span());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        visit::visit_macro(self, call);
        self.read_tokens(call.tokens.clone());
    }

    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        if let syn::Meta::List(list) = &attribute.meta {
            self.read_tokens(list.tokens.clone());
        }
    }

    // Who may see it is not what it needs.
    fn visit_visibility(&mut self, _: &'ast syn::Visibility) {}
}
