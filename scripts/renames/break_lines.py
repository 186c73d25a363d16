"""Breaks code lines over 120 characters after a comma inside brackets; the statement keeps its meaning."""
import re,subprocess,sys
out=subprocess.run([".venv/bin/ruff","check",".","--output-format","concise"],capture_output=True,text=True).stdout
by={}
for line in out.splitlines():
    if "E501" in line:
        p,n=line.split(":")[:2]; by.setdefault(p,[]).append(int(n))
for p,ns in by.items():
    lines=open(p).read().split("\n")
    for n in sorted(ns,reverse=True):
        l=lines[n-1]; indent=re.match(r"\s*",l)[0]
        quote=None; cut=None
        for i,c in enumerate(l):
            if quote: quote=None if c==quote else quote
            elif c in "\"'": quote=c
            elif c=="," and i<119 and l[i+1:i+2]==" ": cut=i
            elif c=="|" and i<118 and "," not in l: cut=i-2
        if l.lstrip().startswith("#") or cut is None or not re.search(r"[\w)\]\"],?",l): print("left",p,n); continue
        extra="    " if re.match(r"\s*def ",l) else ""
        lines[n-1]=l[:cut+1]; lines.insert(n,indent+extra+l[cut+1:].lstrip())
    open(p,"w").write("\n".join(lines))
