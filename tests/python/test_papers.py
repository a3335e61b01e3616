"""Pictures for papers, as other programs read them: sizes, density, and text that is text."""

import subprocess
import tempfile
import unittest
from pathlib import Path

import pypdf
from PIL import Image

from common import CURVELAX, run

MM_PER_INCH = 25.4


class Papers(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        home = tempfile.TemporaryDirectory()
        cls.addClassCleanup(home.cleanup)
        cls.out = run("--curves 6 --points 32 --adaptive=1e-3 --t-end 1 --quiet", Path(home.name) / "out")
        command = [CURVELAX, "plot", str(cls.out), "--format", "png,pdf", "--width", "90", "--dpi", "200", "--quiet"]
        subprocess.run(command, check=True)
        cls.names = [path.stem for path in sorted((cls.out / "plots").glob("*.svg"))]

    def test_a_png_has_the_width_and_the_density_that_were_asked_for(self):
        self.assertGreaterEqual(len(self.names), 8)
        for name in self.names:
            with Image.open(self.out / "plots" / f"{name}.png") as picture:
                self.assertEqual((picture.format, picture.mode, picture.width), ("PNG", "RGB", round(90 / MM_PER_INCH * 200)))
                self.assertAlmostEqual(picture.info["dpi"][0], 200, delta=0.02)
                corners = [picture.getpixel((x, y)) for x in (0, picture.width - 1) for y in (0, picture.height - 1)]
                self.assertEqual(corners, [(255, 255, 255)] * 4, name)
                # Something is drawn, and in colours.
                self.assertGreater(len(picture.getcolors(maxcolors=1 << 24)), 20, name)

    def test_a_pdf_has_one_page_of_that_width_whose_text_can_be_found(self):
        for name, words in [
            ("survival", ["share not relaxed", "t_relax (length⁴)", "95 % band", "0.5"]),
            ("excess", ["mean excess", "(length⁴)", "exp(−24 t/R⁴)"]),
            ("curves", ["relaxed at t = "]),
        ]:
            reader = pypdf.PdfReader(self.out / "plots" / f"{name}.pdf")
            self.assertEqual(len(reader.pages), 1)
            page = reader.pages[0]
            self.assertAlmostEqual(float(page.mediabox.width), 90 / MM_PER_INCH * 72, places=1)
            text = page.extract_text()
            for word in words:
                self.assertIn(word, text, name)
            # What the caption says is not in the picture.
            self.assertNotIn("seed", text)

    def test_fonts_are_embedded(self):
        for name in self.names:
            fonts = pypdf.PdfReader(self.out / "plots" / f"{name}.pdf").pages[0]["/Resources"]["/Font"]
            self.assertTrue(fonts, name)
            for font in fonts.values():
                below = font["/DescendantFonts"][0]
                self.assertIn("DejaVuSans", font["/BaseFont"])
                self.assertTrue({"/FontFile2", "/FontFile3"} & set(below["/FontDescriptor"]), name)


if __name__ == "__main__":
    unittest.main()
