//! Shapes as SVG 1.1 text, without scripts or fonts. Colours are CSS variables of the page around a drawing (`--c0` …
//! `--c7`, `--ink`, `--faint`, `--paper`); [`Svg::file`] gives them values for a drawing in a file. Sizes are in units
//! of the view box.

use std::fmt::Write;

/// Colours that tell series apart.
pub const COLOURS: usize = 8;

/// Colours on white that colour-blind readers can tell apart (Okabe and Ito 2008).
const STYLE: &str = "svg{--c0:#0072b2;--c1:#d55e00;--c2:#009e73;--c3:#cc79a7;--c4:#e69f00;--c5:#56b4e9;--c6:#000;\
--c7:#999;--ink:#222;--faint:#999;--rule:#ddd;--paper:#fff;background:#fff;font:12px sans-serif;fill:#222}\
.grid{stroke:#ddd}.label{font-size:13px}";

/// Where a text stands relative to its place: SVG's `text-anchor`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// To its right.
    Start,
    /// Around it.
    Middle,
    /// To its left.
    End,
}

/// A drawing.
#[derive(Clone, Debug)]
pub struct Svg {
    size: (f64, f64),
    body: String,
}

impl Svg {
    /// Nothing yet, in a view box of this size.
    pub fn new(width: f64, height: f64) -> Self {
        Svg { size: (width, height), body: String::new() }
    }

    /// A line of text.
    pub fn text(&mut self, at: (f64, f64), anchor: Anchor, text: &str) {
        self.styled_text(at, anchor, "", text);
    }

    /// A line of text with further attributes, such as `class` or `font-size`.
    pub fn styled_text(&mut self, (x, y): (f64, f64), anchor: Anchor, attributes: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (space, text) = (if attributes.is_empty() { "" } else { " " }, escaped(text));
        let _ = writeln!(
            self.body,
            r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}"{space}{attributes}>{text}</text>"#
        );
    }

    /// A rectangle from its top left corner, with a style of CSS; `title` shows when the pointer rests on it.
    pub fn rect(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), style: &str, title: &str) {
        let shape = format!(r#"rect x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}" style="{style}""#);
        self.shape("rect", &shape, title);
    }

    /// A line through points, with a style of CSS.
    pub fn line(&mut self, points: &[(f64, f64)], style: &str) {
        let _ = writeln!(self.body, r#"<polyline points="{}" fill="none" style="{style}"/>"#, path(points));
    }

    /// A straight line of a class of the page.
    pub fn rule(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64), class: &str) {
        let _ = writeln!(self.body, r#"<line x1="{x1:.1}" y1="{y1:.1}" x2="{x2:.1}" y2="{y2:.1}" class="{class}"/>"#);
    }

    /// A filled outline in one of the colours, translucent.
    pub fn area(&mut self, points: &[(f64, f64)], colour: usize) {
        let _ =
            writeln!(self.body, r#"<polygon points="{}" style="fill:var(--c{colour});opacity:.18"/>"#, path(points));
    }

    /// A dot with a text that shows when the pointer rests on it.
    pub fn dot(&mut self, (x, y): (f64, f64), colour: usize, hollow: bool, title: &str) {
        let fill = if hollow { "var(--paper)".into() } else { format!("var(--c{colour})") };
        let style = format!("fill:{fill};stroke:var(--c{colour});stroke-width:1.5");
        self.shape("circle", &format!(r#"circle cx="{x:.1}" cy="{y:.1}" r="4" style="{style}""#), title);
    }

    /// A downward arrow from a point, with a style of CSS.
    pub fn arrow_down(&mut self, (x, y): (f64, f64), style: &str) {
        let _ = writeln!(self.body, r#"<path d="M{x:.1} {y:.1}v16m-4 -5l4 5l4 -5" fill="none" style="{style}"/>"#);
    }

    fn shape(&mut self, name: &str, open: &str, title: &str) {
        let _ = match title {
            "" => writeln!(self.body, "<{open}/>"),
            title => writeln!(self.body, "<{open}><title>{}</title></{name}>", escaped(title)),
        };
    }

    /// The drawing for a page that holds it; `title` is read out to those who do not see it.
    pub fn inline(&self, title: &str) -> String {
        let ((width, height), title) = (self.size, escaped(title));
        format!(
            "<svg viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"{title}\"><title>{title}</title>\n\
             {}</svg>",
            self.body
        )
    }

    /// The drawing as a file, with the namespace and values for the colours.
    pub fn file(&self, title: &str) -> String {
        let (width, height) = self.size;
        let open = format!("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" ");
        let styled = format!("<style>{STYLE}</style><title>");
        self.inline(title).replacen("<svg ", &open, 1).replacen("<title>", &styled, 1) + "\n"
    }
}

fn path(points: &[(f64, f64)]) -> String {
    points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
}

/// Text inside markup.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_escaped_and_files_carry_their_colours() {
        assert_eq!(escaped("a<b & \"c\""), "a&lt;b &amp; &quot;c&quot;");
        let mut svg = Svg::new(10.0, 20.0);
        svg.rect((1.0, 2.0), (3.0, 4.0), "fill:var(--c1)", "<1>");
        let (inline, file) = (svg.inline("a & b"), svg.file("a & b"));
        assert!(inline.starts_with("<svg viewBox=\"0 0 10 20\"") && inline.contains("<title>&lt;1&gt;</title></rect>"));
        assert!(!inline.contains("<style>") && file.contains("--c1:#d55e00") && file.ends_with("</svg>\n"));
    }
}
