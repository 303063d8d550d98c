//! Pages that need nothing else: one file with its style, its pictures (PNG in data URIs) and its plots (SVG) in it,
//! light and dark by the reader's scheme. A policy in the page forbids it to fetch anything, whatever is in it.
//!
//! Functions take text and escape it; where they take markup, they say so.

use std::borrow::Cow;
use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::heat::HeatMap;
use super::number::short;
use super::svg::escaped;

const STYLE: &str = include_str!("page.css");

/// Narrower pictures are magnified in a page: by whole pixels.
const SMALL: u32 = 400;

/// A page being written.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    body: String,
    script: &'static str,
}

impl Page {
    /// A page of that title, with a heading.
    pub fn new(title: &str, heading: &str) -> Self {
        Page { title: title.into(), body: format!("<h1>{}</h1>\n", escaped(heading)), script: "" }
    }

    /// A heading of a part.
    pub fn heading(&mut self, text: &str) {
        let _ = writeln!(self.body, "<h2>{}</h2>", escaped(text));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p>{}</p>", escaped(text));
    }

    /// Names and what they are.
    pub fn facts<'f>(&mut self, facts: impl IntoIterator<Item = (&'f str, String)>) {
        self.body.push_str("<dl>");
        for (name, value) in facts {
            let _ = write!(self.body, "<dt>{}</dt><dd>{}</dd>", escaped(name), escaped(&value));
        }
        self.body.push_str("</dl>\n");
    }

    /// A list.
    pub fn list<'l>(&mut self, items: impl IntoIterator<Item = &'l str>) {
        self.body.push_str("<ul>");
        for item in items {
            let _ = write!(self.body, "<li>{}</li>", escaped(item));
        }
        self.body.push_str("</ul>\n");
    }

    /// Text of which every character counts.
    pub fn code(&mut self, text: &str) {
        let _ = writeln!(self.body, "<pre><code>{}</code></pre>", escaped(text));
    }

    /// A table, of cells that are markup; the first column is text, the others numbers.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        self.body.push_str("<div class=\"wide\"><table><thead><tr>");
        for name in head {
            let _ = write!(self.body, "<th>{}</th>", escaped(name));
        }
        self.body.push_str("</tr></thead><tbody>\n");
        for row in rows {
            self.body.push_str("<tr>");
            for cell in row {
                let _ = write!(self.body, "<td>{cell}</td>");
            }
            self.body.push_str("</tr>\n");
        }
        self.body.push_str("</tbody></table></div>\n");
    }

    /// What [`figure`] makes.
    pub fn figure(&mut self, content: &str, legend: &str) {
        self.markup(&figure(content, legend));
    }

    /// Figures side by side.
    pub fn pair(&mut self, figures: impl IntoIterator<Item = String>) {
        self.markup("<div class=\"pair\">\n");
        figures.into_iter().for_each(|figure| self.markup(&figure));
        self.markup("</div>\n");
    }

    /// Markup.
    pub fn markup(&mut self, markup: &str) {
        self.body.push_str(markup);
    }

    /// Runs a script behind the page.
    pub fn script(&mut self, script: &'static str) {
        self.script = script;
    }

    /// The file.
    pub fn finish(self) -> String {
        let Page { title, body, script } = self;
        let (title, allowed) = (escaped(&title), if script.is_empty() { "" } else { "; script-src 'unsafe-inline'" });
        let script: Cow<str> =
            if script.is_empty() { "".into() } else { format!("<script>\n{script}</script>\n").into() };
        format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
             <meta http-equiv=\"Content-Security-Policy\" \
             content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'{allowed}\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style></head>\n<body>\n{body}{script}</body></html>\n"
        )
    }
}

/// A figure of markup and a legend of markup.
pub fn figure(content: &str, legend: &str) -> String {
    format!("<figure>{content}<figcaption>{legend}</figcaption></figure>\n")
}

/// A picture, from the bytes of its PNG file; `alt` is read out to those who do not see it.
pub fn picture(png: &[u8], (width, height): (u32, u32), alt: &str) -> String {
    let class = if width < SMALL { " class=\"small\"" } else { "" };
    format!(
        "<img src=\"data:image/png;base64,{}\" width=\"{width}\" height=\"{height}\"{class} alt=\"{}\">",
        STANDARD.encode(png),
        escaped(alt)
    )
}

/// The scale of a map, in percent.
pub fn scale(map: &HeatMap) -> String {
    format!("<span class=\"scale\"></span> 0 to {} % and above", short(100.0 * map.end))
}

/// A coloured mark and its label.
pub fn mark(colour: usize, text: &str) -> String {
    format!("<span class=\"mark\"><i style=\"background:var(--c{colour})\"></i>{}</span> ", escaped(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_escaped_and_nothing_can_be_fetched() {
        let hostile = "<img src=//a>\"&";
        let mut page = Page::new(hostile, hostile);
        page.heading(hostile);
        page.paragraph(hostile);
        page.facts([(hostile, hostile.to_string())]);
        page.list([hostile]);
        page.code(hostile);
        page.table(&[hostile], &[vec![escaped(hostile)]]);
        page.figure(&picture(b"", (1, 1), hostile), &mark(0, hostile));
        let text = page.clone().finish();
        assert!(text.contains("default-src 'none'") && !text.contains("script-src") && !text.contains("<img src=//"));
        assert_eq!(text.matches("<img").count(), 1);
        assert_eq!(text.matches("&lt;img src=//a&gt;&quot;&amp;").count(), 12);
        page.script("let a;");
        assert!(page.finish().contains("<script>\nlet a;</script>"));
    }
}
