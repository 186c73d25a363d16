"""Renames what programs in strings import. Run after apply.py, with the tables."""
import ast,glob,re,sys
mods,names={}, {}
for t in sys.argv[1:]:
    for line in open(t):
        r=line.rstrip("\n").split("\t")
        if len(r)<3: continue
        k=r[0].split("+")[0]
        if k=="module": mods[r[1]]=r[2]
        elif k in("class","function","constant") and ":" in r[1]:
            m,n=r[1].split(":",1)
            if "." not in n: names[m,n]=r[2]
back={v:k for k,v in mods.items()}
for p in sorted(glob.glob("tests/**/*.py",recursive=True)+glob.glob("app/**/*.py",recursive=True)+glob.glob("ui/**/*.py",recursive=True)):
    s=open(p).read(); out=s
    for node in ast.walk(ast.parse(s)):
        if isinstance(node,ast.Constant) and isinstance(node.value,str) and re.search(r"from (app|engine|ui)\b.* import",node.value):
            seg=ast.get_source_segment(s,node)
            if seg is None: continue
            new=seg
            for mod,imp in re.findall(r"from ((?:app|engine|ui)[\w.]*) import ([\w, ]+)",seg):
                for n in imp.split(","):
                    n=n.strip().split(" as ")[0].strip()
                    old=back.get(mod,mod)
                    if (old,n) in names: new=re.sub(r"(?<![.\w])%s\b"%n,names[old,n],new); print(p,node.lineno,n,"->",names[old,n])
                    if f"{old}.{n}" in mods or f"{mod}.{n}" in mods:
                        q=mods.get(f"{old}.{n}") or mods[f"{mod}.{n}"]
                        if q.rpartition(".")[0]==mod: new=re.sub(r"(?<![.\w])%s\b"%n,q.rpartition(".")[2],new); print(p,node.lineno,"module",n,"->",q)
            out=out.replace(seg,new)
    if out!=s: open(p,"w").write(out)
