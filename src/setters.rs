//! One macro: builder methods for the options' public fields, so that options outside of this crate can be written in a
//! chain although their types are `#[non_exhaustive]`.

/// A method for each field that sets it: `= T` takes the value itself, `into T` whatever becomes it.
macro_rules! setters {
    ($($field:ident: $(into $into:ty)? $(= $type:ty)?,)*) => {
        $(
            #[doc = concat!("Sets the field `", stringify!($field), "`.")]
            pub fn $field(mut self, $field: $(impl Into<$into>)? $($type)?) -> Self {
                self.$field = $crate::setters::setters!(@ $field $(, $into)?);
                self
            }
        )*
    };
    (@ $field:ident, $into:ty) => { $field.into() };
    (@ $field:ident) => { $field };
}

pub(crate) use setters;
