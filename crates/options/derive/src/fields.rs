//! `#[derive(Options)]`.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::{
    Attribute, Data, DeriveInput, Error, Expr, Field, GenericArgument, Ident, LitChar, LitStr,
    Path, PathArguments, Result, Type,
};

use crate::docs;

/// The attributes of a field.
#[derive(Default)]
struct FieldAttributes {
    flatten: bool,
    name: Option<LitStr>,
    aliases: Vec<LitStr>,
    /// Equivalent options of other structs.
    stands_for: Vec<LitStr>,
    short: Option<LitChar>,
    value: Option<LitStr>,
    heading: Option<LitStr>,
    default: Option<Expr>,
    /// The default in words.
    default_text: Option<LitStr>,
    /// Value if the option is given without one.
    bare: Option<LitStr>,
    range: Option<Expr>,
    codec: Option<Path>,
    /// Effect of `--no-NAME`.
    off: Option<LitStr>,
    role: Option<Ident>,
    positional: bool,
    no_setter: bool,
}

/// The attributes of the struct.
struct StructAttributes {
    heading: LitStr,
    rules: Option<Path>,
    /// Setters for builders of one operation (`own`) or of each that has the group (`group`).
    setters: Option<Ident>,
}

/// What a field adds to each impl.
#[derive(Default)]
struct FieldTokens {
    entries: Vec<TokenStream>,
    visits: Vec<TokenStream>,
    mutable_visits: Vec<TokenStream>,
    defaults: Vec<TokenStream>,
    setters: Vec<FieldSetter>,
    groups: Vec<TokenStream>,
}

pub(crate) fn expand(input: &DeriveInput) -> Result<TokenStream> {
    let name = &input.ident;
    let Data::Struct(data) = &input.data else {
        return Err(Error::new_spanned(name, "Options can be derived for structs only"));
    };
    let container = container_attributes(&input.attrs)?;
    let mut parts = FieldTokens::default();
    for field in &data.fields {
        let attributes = field_attributes(&field.attrs)?;
        match attributes.flatten {
            true => parts.add_group(name, field, &container),
            false => parts.add_field(field, &attributes, &container)?,
        }
    }
    let about = docs::text(&input.attrs);
    let FieldTokens { entries, visits, mutable_visits, defaults, setters, groups } = &parts;
    let rules = container.rules.as_ref().map_or_else(|| quote!(&[]), |rules| quote!(#rules));
    let setters = container.setters.as_ref().map(|kind| traits(name, kind, setters));
    Ok(quote! {
        impl ::terrane_options::Options for #name {
            const TABLE: &'static ::terrane_options::OptionTable =
                &::terrane_options::OptionTable { about: #about, entries: &[#(#entries),*], rules: #rules };

            fn visit(&self, visit: &mut ::terrane_options::Visit<'_>) { #(#visits)* }

            fn visit_mut(&mut self, visit: &mut ::terrane_options::VisitMut<'_>) {
                #(#mutable_visits)*
            }
        }

        const _: () = ::terrane_options::assert_rules(<#name as ::terrane_options::Options>::TABLE);

        impl ::core::default::Default for #name {
            fn default() -> Self { Self { #(#defaults),* } }
        }

        #setters
        #(#groups)*
    })
}

fn container_attributes(attributes: &[Attribute]) -> Result<StructAttributes> {
    let mut heading = LitStr::new("Options", proc_macro2::Span::call_site());
    let (mut setters, mut rules) = (None, None);
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("options")) {
        attribute.parse_nested_meta(|meta| {
            match () {
                () if meta.path.is_ident("heading") => heading = meta.value()?.parse()?,
                () if meta.path.is_ident("setters") => setters = Some(meta.value()?.parse()?),
                () if meta.path.is_ident("rules") => rules = Some(meta.value()?.parse()?),
                () => return Err(meta.error("expected heading, rules or setters")),
            }
            Ok(())
        })?;
    }
    Ok(StructAttributes { heading, rules, setters })
}

fn field_attributes(attributes: &[Attribute]) -> Result<FieldAttributes> {
    let mut parsed = FieldAttributes::default();
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("option")) {
        attribute.parse_nested_meta(|meta| {
            let name = meta.path.get_ident().map(Ident::to_string).unwrap_or_default();
            match name.as_str() {
                "flatten" => parsed.flatten = true,
                "positional" => parsed.positional = true,
                "no_setter" => parsed.no_setter = true,
                "name" => parsed.name = Some(meta.value()?.parse()?),
                "alias" => parsed.aliases.push(meta.value()?.parse()?),
                "stands_for" => parsed.stands_for.push(meta.value()?.parse()?),
                "short" => parsed.short = Some(meta.value()?.parse()?),
                "value" => parsed.value = Some(meta.value()?.parse()?),
                "heading" => parsed.heading = Some(meta.value()?.parse()?),
                "default" => parsed.default = Some(meta.value()?.parse()?),
                "default_text" => parsed.default_text = Some(meta.value()?.parse()?),
                "bare" => parsed.bare = Some(meta.value()?.parse()?),
                "range" => parsed.range = Some(meta.value()?.parse()?),
                "with" => parsed.codec = Some(meta.value()?.parse()?),
                "off" => parsed.off = Some(meta.value()?.parse()?),
                "role" => parsed.role = Some(meta.value()?.parse()?),
                _ => return Err(meta.error("unknown attribute of an option")),
            }
            Ok(())
        })?;
    }
    Ok(parsed)
}

impl FieldTokens {
    /// Adds a group: its fields are flattened into the struct.
    fn add_group(&mut self, name: &Ident, field: &Field, container: &StructAttributes) {
        let (ident, ty) = (&field.ident, &field.ty);
        self.entries.push(quote! {
            ::terrane_options::OptionEntry::Group(<#ty as ::terrane_options::Options>::TABLE)
        });
        self.visits.push(quote!(::terrane_options::Options::visit(&self.#ident, visit);));
        self.mutable_visits
            .push(quote!(::terrane_options::Options::visit_mut(&mut self.#ident, visit);));
        self.defaults.push(quote!(#ident: ::core::default::Default::default()));
        if container.setters.is_some() {
            self.groups.push(quote! {
                impl ::terrane_engine::operation::HasGroup<#ty> for #name {
                    fn part(&self) -> &#ty { &self.#ident }

                    fn part_mut(&mut self) -> &mut #ty { &mut self.#ident }
                }
            });
        }
    }

    fn add_field(
        &mut self,
        field: &Field,
        attributes: &FieldAttributes,
        container: &StructAttributes,
    ) -> Result<()> {
        let ty = &field.ty;
        let Some(ident) = &field.ident else {
            return Err(Error::new_spanned(field, "an option needs a name"));
        };
        let about = docs::text(&field.attrs);
        if about.is_empty() {
            return Err(Error::new_spanned(field, "an option needs a doc comment"));
        }
        let called = attributes.name.as_ref().map_or_else(|| ident.to_string(), LitStr::value);
        let codec = attributes.codec.as_ref();
        let codec =
            codec.map_or_else(|| quote!(::terrane_options::PlainCodec), |path| quote!(#path));
        let heading = attributes.heading.as_ref().unwrap_or(&container.heading);
        let FieldAttributes { aliases, stands_for, default, positional, .. } = attributes;
        let (short, default_text) =
            (optional(attributes.short.as_ref()), optional(attributes.default_text.as_ref()));
        let (off, value) = (optional(attributes.off.as_ref()), optional(attributes.value.as_ref()));
        let (range, bare) =
            (optional(attributes.range.as_ref()), optional(attributes.bare.as_ref()));
        let role = attributes.role.clone().unwrap_or_else(|| format_ident!("Result"));
        self.entries.push(
            quote!(::terrane_options::OptionEntry::Field(::terrane_options::OptionField {
                name: #called,
                aliases: &[#(#aliases),*],
                stands_for: &[#(#stands_for),*],
                short: #short,
                about: #about,
                off: #off,
                heading: #heading,
                positional: #positional,
                value: #value,
                default_text: #default_text,
                bare: #bare,
                range: #range,
                role: ::terrane_options::OptionRole::#role,
                kind: <#codec as ::terrane_options::OptionCodec<#ty>>::KIND,
                shape: <#codec as ::terrane_options::OptionCodec<#ty>>::SHAPE,
                read: ::terrane_options::read_text::<#ty, #codec>,
            })),
        );
        self.visits.push(
            quote!(visit(#called, &::terrane_options::CodecValue::<#ty, #codec>::new(&self.#ident));),
        );
        self.mutable_visits.push(
            quote!(visit(#called, &mut ::terrane_options::Settable::<#ty, #codec>::new(&mut self.#ident));),
        );
        self.defaults.push(match default {
            Some(value) => quote!(#ident: #value),
            None => quote!(#ident: ::core::default::Default::default()),
        });
        if !attributes.no_setter {
            self.setters.push(FieldSetter::new(field, ident));
        }
        Ok(())
    }
}

fn optional<T: quote::ToTokens>(value: Option<&T>) -> TokenStream {
    match value {
        Some(value) => quote!(::core::option::Option::Some(#value)),
        None => quote!(::core::option::Option::None),
    }
}

/// The setter of a field.
struct FieldSetter {
    docs: Vec<Attribute>,
    ident: Ident,
    /// Parameter type.
    taken: TokenStream,
    /// Value of the field.
    value: TokenStream,
}

impl FieldSetter {
    /// Setter of a field; for an optional field it takes the inner value.
    fn new(field: &Field, ident: &Ident) -> Self {
        let docs = field.attrs.iter().filter(|attribute| attribute.path().is_ident("doc"));
        let inner = inner(&field.ty);
        let ty = inner.unwrap_or(&field.ty);
        let (taken, value) = match is_number(ty) {
            true => (quote!(#ty), quote!(value)),
            false => (quote!(impl Into<#ty>), quote!(value.into())),
        };
        let value = if inner.is_some() { quote!(Some(#value)) } else { value };
        Self { docs: docs.cloned().collect(), ident: ident.clone(), taken, value }
    }
}

/// A trait of setters for the fields of a struct, for jobs whose options are that struct or contain it as a group.
fn traits(name: &Ident, kind: &Ident, setters: &[FieldSetter]) -> TokenStream {
    let text = name.to_string();
    let about = format!("Setters of [`{name}`].");
    let called = format_ident!("{}Setters", text.strip_suffix("Options").unwrap_or(&text));
    let signatures = setters.iter().map(|FieldSetter { docs, ident, taken, .. }| {
        quote! {
            #(#docs)*
            #[must_use]
            fn #ident(self, value: #taken) -> Self;
        }
    });
    let is_own = kind == "own";
    let done = setters.iter().map(|FieldSetter { ident, taken, value, .. }| {
        let place = match is_own {
            true => quote!(self.options_mut().#ident),
            false => quote!(::terrane_engine::operation::HasGroup::<#name>::part_mut(self.options_mut()).#ident),
        };
        quote! {
            fn #ident(mut self, value: #taken) -> Self {
                #place = #value;
                self
            }
        }
    });
    let jobs = match is_own {
        true => quote!(impl<S> #called for ::terrane_engine::operation::Job<'_, #name, S>),
        false => quote! {
            impl<O: ::terrane_engine::operation::HasGroup<#name>, S> #called for ::terrane_engine::operation::Job<'_, O, S>
        },
    };
    quote! {
        #[doc = #about]
        pub trait #called: Sized { #(#signatures)* }

        #jobs { #(#done)* }
    }
}

/// Type argument of an `Option`.
fn inner(ty: &Type) -> Option<&Type> {
    let Type::Path(path) = ty else { return None };
    let last = path.path.segments.last().filter(|last| last.ident == "Option")?;
    let PathArguments::AngleBracketed(arguments) = &last.arguments else { return None };
    match arguments.args.first() {
        Some(GenericArgument::Type(ty)) => Some(ty),
        _ => None,
    }
}

/// True for types for which `impl Into` would make literals ambiguous.
fn is_number(ty: &Type) -> bool {
    let Type::Path(path) = ty else { return false };
    ["bool", "u8", "u16", "u32", "u64", "usize", "i32", "f64"]
        .iter()
        .any(|name| path.path.is_ident(name))
}
