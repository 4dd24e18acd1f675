"""The calls about models: what shows a frame, which versions there are, and which of them serve."""

from __future__ import annotations

from typing import Optional

from . import calls
from .calls import Archive, Frame
from .senses import Scan
from .steps import Method, Steps, ask, tell
from .types import Answer, Model, ModelList, Version


class ModelCalls:
    """The calls about models."""

    @Method
    def recognize(
        self,
        frame: Frame,
        *,
        robot: Optional[str] = None,
        model: Optional[str] = None,
        version: Optional[int] = None,
        label: Optional[str] = None,
        captured_at: Optional[str] = None,
        deadline_ms: Optional[int] = None,
        top: Optional[int] = None,
        explain: Optional[bool] = None,
        scan: Optional[Scan] = None,
    ) -> Steps[Answer]:
        """The room of one encoded image, given as bytes or as the path of a file.

        ``scan`` is what the robot's laser measured beside it, for models that look at that. ``deadline_ms`` is how long the frame may wait, ``top`` how many rooms to name. Raises ``Refused``,
        ``ConnectionLost`` or ``ProtocolError``.
        """
        query = {
            "robot": robot,
            "model": model,
            "version": version,
            "label": label,
            "captured_at": captured_at,
            "deadline_ms": deadline_ms,
            "top": top,
            "explain": explain,
        }
        return ask(Answer, "POST", "/v1/recognize", params=calls.given(query), **calls.frame_body(frame, scan))

    @Method
    def models(self) -> Steps[ModelList]:
        """The models there are."""
        return ask(ModelList, "GET", "/v1/models")

    @Method
    def model(self, name: str) -> Steps[Model]:
        """One model, with its versions."""
        return ask(Model, "GET", calls.path("models", name))

    @Method
    def version(self, name: str, version: int) -> Steps[Version]:
        """One version of a model, with its card."""
        return ask(Version, "GET", calls.path("models", name, "versions", version))

    @Method
    def activate(self, name: str, version: int, *, epoch: Optional[int] = None) -> Steps[Version]:
        """Lets a version serve. Where an ``epoch`` is given (``Model.epoch``) and what serves was changed since, it is
        ``Refused``; the same holds for the other changes."""
        url = calls.path("models", name, "versions", version, "activate")
        return ask(Version, "POST", url, headers=calls.if_match(epoch))

    @Method
    def roll_back(self, name: str, *, epoch: Optional[int] = None) -> Steps[Model]:
        """Lets the version serve that did before."""
        return ask(Model, "POST", calls.path("models", name, "rollback"), headers=calls.if_match(epoch))

    @Method
    def set_label(
        self, name: str, label: str, version: int, *, share: Optional[float] = None, epoch: Optional[int] = None
    ) -> Steps[Model]:
        """Gives a label such as ``canary`` (with its ``share`` of the robots) or ``shadow`` to a version."""
        url, body = calls.path("models", name, "labels", label), calls.given({"version": version, "share": share})
        return ask(Model, "PUT", url, json=body, headers=calls.if_match(epoch))

    @Method
    def remove_label(self, name: str, label: str, *, epoch: Optional[int] = None) -> Steps[Model]:
        """Takes a label away."""
        return ask(Model, "DELETE", calls.path("models", name, "labels", label), headers=calls.if_match(epoch))

    @Method
    def make_default(self, name: str) -> Steps[Model]:
        """Lets a model answer requests that name none."""
        return ask(Model, "PUT", calls.path("models", name, "default"))

    @Method
    def upload(self, name: str, version: int, archive: Archive) -> Steps[Version]:
        """Adds a version of a model: its folder as a tar, tar.gz or zip file."""
        url, body = calls.path("models", name, "versions", version), calls.archive_body(archive)
        # Packing and loading take longer than other calls.
        return ask(Version, "PUT", url, timeout=calls.UPLOAD_PATIENCE_S, **body)

    @Method
    def delete(self, name: str, version: int, *, epoch: Optional[int] = None) -> Steps[None]:
        """Deletes a version that has no label."""
        return tell("DELETE", calls.path("models", name, "versions", version), headers=calls.if_match(epoch))
