"""What all recordings in MCAP files share: a scan of the file, and messages that are read as they are asked for."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import InvalidInputError, RecordingError
from . import ros2_messages as ros2
from .contents import Contents, Wanted
from .file_recording import FileRecording
from .mcap_scan import MessageAt, scan
from .ros2_file import FORMAT_VERSION, METADATA_NAME, NOTE_NAME


class McapBase(FileRecording):
    """A scanned file. metadata: the text in it.

    Raises RecordingError when the file is missing, is no MCAP file or of a version that is not known.
    """

    def __init__(self, path: str | Path, wanted: Mapping[str, Wanted], contents: Contents | None = None) -> None:
        self.path = Path(path)
        self.left_out = {}
        self._contents = scan(self.path, wanted) if contents is None else contents
        self.damage = self._contents.damage
        texts = self._contents.metadata
        self.metadata = {**texts.get(METADATA_NAME, {}), **texts.get(NOTE_NAME, {})}

    @property
    def is_complete(self) -> bool:
        """False when the file is damaged or was cut off: some observations are then missing."""
        return self.damage is None

    @contextmanager
    def _opening(self) -> Iterator[None]:
        """Turn what is wrong with the contents into a RecordingError that names the file, and its damage."""
        try:
            version = self.metadata.get("format_version", FORMAT_VERSION)
            if version != FORMAT_VERSION:
                raise InvalidInputError(f"recording format {version!r} is not known, only {FORMAT_VERSION!r}")
            yield
        except InvalidInputError as error:
            raise RecordingError(f"{self.path}: {error}" + (f" ({self.damage})" if self.damage else "")) from error

    def _message(self, topic: str, stamp_ns: int, message_at: MessageAt) -> Any:
        message = message_at(self._contents.messages[topic][stamp_ns])
        return ros2.decoder(self._contents.types[topic])(message.data)
