"""Imports and dotted names inside strings of tests and sources that do not resolve."""
import ast,glob,importlib,re,sys
sys.path.insert(0,".")
def exists(mod,name=None):
    import os
    path=mod.replace(".","/")
    if not(os.path.exists(path+".py") or os.path.isdir(path)): return False
    if name is None or os.path.isdir(path) and (os.path.exists(f"{path}/{name}.py") or os.path.isdir(f"{path}/{name}")): return True
    f=path+".py" if os.path.exists(path+".py") else path+"/__init__.py"
    return os.path.exists(f) and re.search(r"\b%s\b"%re.escape(name),open(f).read()) is not None
for p in glob.glob("**/*.py",recursive=True):
    if p.startswith((".venv","out")): continue
    tree=ast.parse(open(p).read())
    for node in ast.walk(tree):
        if isinstance(node,ast.Constant) and isinstance(node.value,str):
            for mod,names in re.findall(r"from ((?:app|engine|ui|tests|assets)[\w.]*) import ([\w, ]+)",node.value):
                for n in re.split(r",\s*",names.strip()):
                    n=n.split(" as ")[0].strip().split()[0]
                    if n and not exists(mod,n): print(p,node.lineno,"from",mod,"import",n)
            for m in re.finditer(r"(?<![\w./])((?:app|engine|ui|tests)(?:\.\w+)+)(?::(\w+))?",node.value):
                parts=m[1].split(".")
                if parts[-1] in("py","glsl","toml","md") : continue
                ok=False
                for k in range(len(parts),0,-1):
                    if exists(".".join(parts[:k])):
                        ok = k==len(parts) or exists(".".join(parts[:k]),parts[k]); 
                        if k==1 : ok=False
                        break
                if not ok and len(parts)>1: print(p,node.lineno,m[0])
