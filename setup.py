"""Copy the folders that the checkout keeps at its top level into the built package."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

TOP = Path(__file__).parent
# Folder in the package, folder in the checkout, and the files to copy.
COPIES = (
    ("ncrs/conf", "conf", "**/*.yaml"),
    ("ncrs/champions", "assets/champions", "*-*.*"),
)


class BuildPackage(build_py):
    """Builds the package; an editable installation uses the checkout's folders as they are."""

    def run(self):
        """Build, then copy."""
        super().run()
        if not self.editable_mode:
            for file, target in self._copies():
                target.parent.mkdir(parents=True, exist_ok=True)
                self.copy_file(str(file), str(target))

    def get_outputs(self, include_bytecode=True):
        """List the files of the build, the copies too."""
        copies = [] if self.editable_mode else self._copies()
        return [*super().get_outputs(include_bytecode), *(str(target) for _, target in copies)]

    def _copies(self):
        for package, folder, pattern in COPIES:
            for file in sorted((TOP / folder).glob(pattern)):
                yield file, Path(self.build_lib) / package / file.relative_to(TOP / folder)


setup(cmdclass={"build_py": BuildPackage})
