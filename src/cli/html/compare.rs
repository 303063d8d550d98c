//! The page of `compare --html`: an image, its reference, their difference and FLIP in one place, to be switched by
//! clicks and keys, and the metrics.

use std::path::Path;

use super::{picture, record};
use crate::accuracy::flip;
use crate::accuracy::verdict::Judgement;
use crate::film::exr::Picture;
use crate::plot::heat::HeatMap;
use crate::plot::html::Page;
use crate::plot::number::short;
use crate::plot::svg::escaped;

/// A picture and its file.
pub type Named<'n> = (&'n Path, &'n Picture);

/// The page of two pictures of one size, with the map of their relative difference and what was found.
pub fn page(image: Named, reference: Named, difference: &HeatMap, found: &Judgement) -> String {
    let names = [image, reference].map(|(path, _)| path.display().to_string());
    let title = format!("{} against {}", names[0], names[1]);
    let mut page = Page::new(&format!("pathspace compare: {title}"), &title);
    let size = (image.1.width as u32, image.1.height as u32);
    let shown = |picture: &Picture| -> Vec<u8> {
        picture.rgb.iter().flat_map(|rgb| picture::clipped(rgb.map(f64::from))).collect()
    };
    let flip = flip::hdr_flip_map(&image.1.rgb, &reference.1.rgb, image.1.width);
    let flip = HeatMap::up_to(1.0, &flip.into_iter().map(f64::from).collect::<Vec<_>>());
    let flip_legend = format!("HDR-FLIP: <span class=\"scale\"></span> 0 to 1; its mean is {}.", short(found.flip));
    page.paragraph(
        "Keys 1 to 4 and the buttons show one of the pictures; a click on it or the key F goes to the image, and from \
         there to the reference.",
    );
    page.markup("<div class=\"stack\">\n");
    page.markup(&picture::figure(&shown(image.1), size, "image", &format!("The image, {}.", escaped(&names[0]))));
    let legend = format!("The reference, {}.", escaped(&names[1]));
    page.markup(&picture::figure(&shown(reference.1), size, "reference", &legend));
    let what = "Difference of each pixel, relative to the reference";
    page.markup(&picture::map(difference, size, "difference", what));
    page.markup(&picture::figure(&flip.bytes, size, "FLIP", &flip_legend));
    page.markup("</div>\n");
    page.heading("Metrics");
    page.table(&["of the image against the reference", "value"], &record::rows(found, &[]));
    page.paragraph(
        "relMSE is the mean of (A − B)²/(B² + ε), ε = 0.01·mean(B)²; trimmed: without the worst 0.1 % of pixels. The \
         pictures are shown as previews are: sRGB, cut off at 0 and 1.",
    );
    page.script(include_str!("switch.js"));
    page.finish()
}
