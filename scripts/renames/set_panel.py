"""Renames fields named by strings in SetPanel({...}) after apply.py."""
import ast,csv,glob,re,sys
new={}
for t in sys.argv[1:]:
    for line in open(t):
        r=line.rstrip("\n").split("\t")
        if len(r)>2 and r[1].startswith("ui.panels.state:PanelState."): new[r[1].rsplit(".",1)[1]]=r[2]
print(new)
for p in sorted(glob.glob("ui/**/*.py",recursive=True)+glob.glob("tests/**/*.py",recursive=True)+glob.glob("app/**/*.py",recursive=True)+glob.glob("assets/**/*.py",recursive=True)):
    s=open(p).read()
    if "SetPanel" not in s and "PanelState" not in s: continue
    lines=s.split("\n"); edits=[]
    for node in ast.walk(ast.parse(s)):
        if isinstance(node,ast.Call) and (getattr(node.func,"id",None)=="SetPanel" or getattr(node.func,"attr",None)=="SetPanel"):
            for k in ast.walk(node):
                if isinstance(k,ast.Dict):
                    for key in k.keys:
                        if isinstance(key,ast.Constant) and key.value in new: edits.append((key.lineno,key.col_offset,key.value))
    for ln,col,v in sorted(set(edits),reverse=True):
        b=lines[ln-1].encode(); q=b[col:col+1]
        assert b[col+1:col+1+len(v)].decode()==v,(p,ln)
        lines[ln-1]=(b[:col+1]+new[v].encode()+b[col+1+len(v):]).decode(); print(p,ln,v)
    if edits: open(p,"w").write("\n".join(lines))
