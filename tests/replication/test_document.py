"""A report written twice from the same blocks."""

from __future__ import annotations

from freqrail.replication.document import Bullets, Heading, Image, Paragraph, Table, markdown, web_page

BLOCKS = [
    Heading(1, "A < B"),
    Paragraph("**Bold** and `code` and [there](#a-b) with |bars|"),
    Bullets(["5 MN/m at 250 km/h, 3 %", "two 4 stones"]),
    Table(("claim", "verdict"), [["a | b", "does not hold"]]),
    Image("figure", "A title", "what to see"),
]


def test_markdown_keeps_tables_whole_and_links_the_figures():
    text = markdown(BLOCKS)
    assert "# A < B\n" in text
    assert "| a \\| b | does not hold |" in text
    assert "![A title](figure.svg)" in text
    assert "- 5 MN/m at 250 km/h, 3 %\n- two 4 stones" in text


def test_the_page_holds_its_figures_and_names_every_cell_for_narrow_screens(tmp_path):
    (tmp_path / "figure.svg").write_bytes(b"<svg/>")
    page = web_page(BLOCKS, tmp_path)
    assert "data:image/svg+xml;base64,PHN2Zy8+" in page
    assert '<h1 id="a-b">A &lt; B</h1>' in page
    assert '<td data-head="verdict" class="is-does-not-hold">' in page
    assert "<strong>Bold</strong>" in page
    assert "5&nbsp;MN/m at 250&nbsp;km/h, 3&nbsp;%" in page
    assert "4 stones" in page
    assert "viewport" in page
    for outside in ("http://", "https://", "<script"):
        assert outside not in page
