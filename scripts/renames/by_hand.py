"""What the tools leave: run in the worktree after break_lines.py."""
def sub(p, *pairs):
    s = open(p).read()
    for a, b in pairs:
        if a not in s: print("not found", p, a[:60]); continue
        s = s.replace(a, b)
    open(p, "w").write(s)
sub("app/orbit/orbit_controller.py", ('''    document,
    view ─► PrepareOrbit ─► OrbitProgress ─► DrawOrbit ─► OrbitPictureDrawn ─► OrbitPicture     a new one each frame
    the view rests,
    its picture is whole ─► PlacementController ─► Placement's events                    fades in over that
''','''    document, view ─► PrepareOrbit ─► OrbitProgress ─► DrawOrbit ─► OrbitPictureDrawn ─► OrbitPicture    each frame
    the view rests, its picture is whole ─► PlacementController ─► Placement's events          fades in over that
'''),('''            shown is not None and shown.quality == "rest" and (shown.viewpoint, shown.poses) == (self._viewpoint,
            self._poses)
''','''            shown is not None and shown.quality == "rest"
            and (shown.viewpoint, shown.poses) == (self._viewpoint, self._poses)
'''))
sub("tests/engine/test_compiled_words.py", ('''single(1, 2), double((1, 2, 3)), double((0, 3, 3)),"
    " double(1), 1.0,''','''single(1, 2), double((1, 2, 3)),"
    " double((0, 3, 3)), double(1), 1.0,'''))
sub("ui/panels/operator_list.py", ('''*((0.0, 90.0) if along else (-number_fields.LARGEST,
        number_fields.LARGEST)),''','''
        *((0.0, 90.0) if along else (-number_fields.LARGEST, number_fields.LARGEST)),'''))
import glob, re
for p in glob.glob("tests/ui/*.py") + glob.glob("tests/ui/gl/*.py"):
    s = open(p).read()
    def fix(m):
        t = m[0]
        for a, b in ((r"\bstate\.notice\b", "state.message"), (r"\bstate\.leaving\b", "state.pending_action"), (r"\beditor\.looks\b", "editor.camera_history"), (r"\bstate\.alone\b", "state.single_panel")):
            t = re.sub(a, b, t)
        return t
    new = re.sub(r"\"[^\"\n]*\"", fix, s)
    if new != s: open(p, "w").write(new)
sub("app/deform/deform_controller.py", ('"lost": self._lost, "alone": self._deform_only', '"lost": self._lost, "deform_only": self._deform_only'))
sub("ui/panels/deformers.py", ('getattr(context.status, "alone", ())', 'getattr(context.status, "deform_only", ())'))
