"""The command of the Python package, before the program in it begins."""

import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

PACKAGE = pathlib.Path(__file__).resolve().parents[2] / "python/curvelax"
# As Ctrl-C while a module is imported.
INTERRUPT = "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n"
# The script that pip makes of the entry point, and the module.
ENTRIES = [["-c", "import sys\nfrom curvelax._program import main\nsys.exit(main())"], ["-m", "curvelax"]]


@unittest.skipIf(os.name == "nt", "os.kill ends the process there")
class Program(unittest.TestCase):
    def setUp(self):
        home = tempfile.TemporaryDirectory()
        self.addCleanup(home.cleanup)
        self.home = pathlib.Path(home.name)
        shutil.copytree(PACKAGE, self.home / "curvelax", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
        # A job in the background ignores Ctrl-C, and so would its children.
        self.addCleanup(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, signal.default_int_handler))

    def start(self, entry, **modules):
        """Starts the command with these modules, by their texts."""
        for name, text in modules.items():
            place = self.home / "curvelax" if name == "_curvelax" else self.home
            (place / f"{name}.py").write_text(text)
        environment = {**os.environ, "PYTHONPATH": str(self.home)}
        ended = subprocess.run([sys.executable, *entry, "a", "b"], env=environment, capture_output=True, text=True)
        return ended.returncode, ended.stdout, ended.stderr

    def test_ctrl_c_while_the_program_is_loaded_ends_it_without_a_word(self):
        for entry in ENTRIES:
            # A shell reports 130.
            self.assertEqual(self.start(entry, _curvelax=INTERRUPT), (-signal.SIGINT, "", ""), entry)

    def test_the_program_is_loaded_without_the_packages_of_the_library(self):
        program = "__version__ = ''\ndef main(arguments):\n    print(arguments, flush=True)\n    return 75\n"
        for entry in ENTRIES:
            ended = self.start(entry, _curvelax=program, numpy=INTERRUPT, pandas=INTERRUPT)
            self.assertEqual(ended, (75, "['curvelax', 'a', 'b']\n", ""), entry)


if __name__ == "__main__":
    unittest.main()
