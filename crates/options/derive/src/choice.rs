//! `#[derive(Choice)]`.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Data, DeriveInput, Error, Fields, LitStr, Result};

use crate::docs;

pub(crate) fn expand(input: &DeriveInput) -> Result<TokenStream> {
    let name = &input.ident;
    let Data::Enum(data) = &input.data else {
        return Err(Error::new_spanned(name, "Choice can be derived for enums only"));
    };
    let mut choices = Vec::new();
    for variant in &data.variants {
        if !matches!(variant.fields, Fields::Unit) {
            return Err(Error::new_spanned(variant, "a variant of a Choice must not have fields"));
        }
        let ident = &variant.ident;
        let mut called = dashed(&ident.to_string());
        for attribute in variant.attrs.iter().filter(|own| own.path().is_ident("choice")) {
            attribute.parse_nested_meta(|meta| match meta.path.is_ident("name") {
                true => {
                    called = meta.value()?.parse::<LitStr>()?.value();
                    Ok(())
                }
                false => Err(meta.error("expected name")),
            })?;
        }
        let about = docs::text(&variant.attrs);
        let about = about.split("\n\n").next().unwrap_or_default();
        choices.push(
            quote!((#name::#ident, ::terrane_options::ChoiceName { name: #called, about: #about })),
        );
    }
    Ok(quote! {
        impl ::terrane_options::Choice for #name {
            const ALL: &'static [(Self, ::terrane_options::ChoiceName)] = &[#(#choices),*];
        }

        impl ::terrane_options::OptionCodec<#name> for ::terrane_options::PlainCodec {
            const KIND: ::terrane_options::OptionKind =
                ::terrane_options::OptionKind::Choice(<#name as ::terrane_options::Choice>::names);

            fn parse(text: &str) -> ::core::result::Result<#name, ::std::string::String> {
                <#name as ::terrane_options::Choice>::named(text)
            }

            fn json(value: &#name) -> ::terrane_options::Json {
                <#name as ::terrane_options::Choice>::name(*value).into()
            }
        }
    })
}

/// `ZevenbergenThorne` as `zevenbergen-thorne`.
fn dashed(variant: &str) -> String {
    let mut name = String::new();
    for c in variant.chars() {
        if c.is_uppercase() && !name.is_empty() {
            name.push('-');
        }
        name.extend(c.to_lowercase());
    }
    name
}
