import struct,json,sys,glob,os,math
def obj(p):
    v=[]
    for l in open(p):
        if l.startswith('v '):
            a=l.split(); v+= [struct.unpack('<f',struct.pack('<f',float(x)))[0] for x in a[1:4]]
    return v
def ply(p):
    b=open(p,'rb').read(); h=b.index(b'end_header\n')+11
    n=[int(l.split()[2]) for l in b[:h].decode().splitlines() if l.startswith('element vertex')][0]
    return list(struct.unpack('<%df'%(3*n),b[h:h+12*n]))
def glb(p):
    b=open(p,'rb').read(); jl=struct.unpack('<I',b[12:16])[0]; g=json.loads(b[20:20+jl]); bin=b[28+jl:]
    def acc(i):
        a=g['accessors'][i]; bv=g['bufferViews'][a['bufferView']]
        k={'SCALAR':1,'VEC2':2,'VEC3':3,'VEC4':4,'MAT4':16}[a['type']]; f={5126:'f',5123:'H',5121:'B',5125:'I'}[a['componentType']]
        sz=struct.calcsize(f)*k; st=bv.get('byteStride',sz); o=bv.get('byteOffset',0)+a.get('byteOffset',0)
        return [struct.unpack_from('<%d%s'%(k,f),bin,o+i*st) for i in range(a['count'])]
    an=g['animations'][0]; times=sorted({t[0] for s in an['samplers'] for t in acc(s['input'])})
    def mat(t,q,s):
        x,y,z,w=q; R=[[1-2*(y*y+z*z),2*(x*y-z*w),2*(x*z+y*w)],[2*(x*y+z*w),1-2*(x*x+z*z),2*(y*z-x*w)],[2*(x*z-y*w),2*(y*z+x*w),1-2*(x*x+y*y)]]
        return [[R[i][j]*s[j] for j in range(3)]+[t[i]] for i in range(3)]+[[0,0,0,1]]
    mul=lambda a,b:[[sum(a[i][k]*b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]
    chan=[(c['target']['node'],c['target']['path'],[t[0] for t in acc(an['samplers'][c['sampler']]['input'])],acc(an['samplers'][c['sampler']]['output'])) for c in an['channels']]
    frames=[]
    meshnode=[i for i,n in enumerate(g['nodes']) if 'skin' in n][0]; nd=g['nodes'][meshnode]; skin=g['skins'][nd['skin']]
    prim=g['meshes'][nd['mesh']]['primitives'][0]['attributes']
    P=acc(prim['POSITION']);J=acc(prim['JOINTS_0']);W=acc(prim['WEIGHTS_0']);IB=acc(skin['inverseBindMatrices'])
    for t in times:
        loc={}
        for i,n in enumerate(g['nodes']):
            if 'matrix' in n: m=n['matrix']; loc[i]=('m',[[m[4*c+r] for c in range(4)] for r in range(4)])
            else: loc[i]=('t',list(n.get('translation',(0,0,0))),list(n.get('rotation',(0,0,0,1))),list(n.get('scale',(1,1,1))))
        for node,path,ts,out in chan:
            k=max(0,min(len(ts)-2,sum(1 for x in ts if x<=t)-1)); a=(t-ts[k])/(ts[k+1]-ts[k]); a=max(0,min(1,a))
            u,v=out[k],out[k+1]
            if path=='rotation':
                d=sum(x*y for x,y in zip(u,v)); v=[x*(-1 if d<0 else 1) for x in v]; d=abs(d)
                if a==0: r=list(u)
                elif a==1: r=list(v)
                else:
                    th=math.acos(min(1,d)); r=[(math.sin((1-a)*th)*x+math.sin(a*th)*y)/math.sin(th) if th>1e-6 else x for x,y in zip(u,v)]
                n=math.sqrt(sum(x*x for x in r)); r=[x/n for x in r]
            else: r=[x+(y-x)*a for x,y in zip(u,v)]
            l=loc[node]; l=list(l); l[{'translation':1,'rotation':2,'scale':3}[path]]=r; loc[node]=tuple(l)
        glob_={}
        def go(i,parent):
            l=loc[i]; m=l[1] if l[0]=='m' else mat(*l[1:]); m=mul(parent,m); glob_[i]=m
            for c in g['nodes'][i].get('children',[]): go(c,m)
        I=[[float(i==j) for j in range(4)] for i in range(4)]
        for r in g['scenes'][g.get('scene',0)]['nodes']: go(r,I)
        JM=[mul(glob_[j],[[IB[k][4*c+r] for c in range(4)] for r in range(4)]) for k,j in enumerate(skin['joints'])]
        fr=[]
        for p,j,w in zip(P,J,W):
            q=[0,0,0]
            sw=sum(w)
            for jj,ww in zip(j,w):
                if ww: m=JM[jj]; q=[q[r]+ww/sw*(m[r][0]*p[0]+m[r][1]*p[1]+m[r][2]*p[2]+m[r][3]) for r in range(3)]
            fr+=q
        frames.append(fr)
    return frames
def faces_obj(p):
    return [[int(x.split('/')[0])-1 for x in l.split()[1:]] for l in open(p) if l.startswith('f ')]
def faces_ply(p):
    b=open(p,'rb').read(); h=b.index(b'end_header\n')+11; L=b[:h].decode().splitlines()
    n=[int(l.split()[2]) for l in L if l.startswith('element vertex')][0]; m=[int(l.split()[2]) for l in L if l.startswith('element face')][0]
    i=L.index('element face %d'%m); extra=sum(1 for l in L[i+2:] if l.startswith('property uchar'))
    o=h+12*n; out=[]
    for _ in range(m):
        assert b[o]==3; out.append(struct.unpack_from('<3I',b,o+1)); o+=13+extra
    return out
src,red,tol=sys.argv[1],sys.argv[2],float(sys.argv[3])
frames=glb(src) if src.endswith('.glb') else [obj(f) for f in sorted(glob.glob(src+'/*.obj'),key=lambda p:int(os.path.basename(p)[:-4]))]
perm=None
T=json.load(open(red+'/times.json')); keys=[(f['time'],ply(red+'/'+f['file'])) for f in T['frames']]
if not src.endswith('.glb'):
    fo=faces_obj(sorted(glob.glob(src+'/*.obj'),key=lambda p:int(os.path.basename(p)[:-4]))[0]); fp=faces_ply(red+'/'+T['frames'][0]['file'])
    assert len(fo)==len(fp) and all(len(f)==3 for f in fo)
    perm={}
    for a,b in zip(fo,fp):
        for x,y in zip(a,b): assert perm.setdefault(x,y)==y
    moved=[]
    for f in frames:
        g=[None]*len(f)
        for x,y in perm.items(): g[3*y:3*y+3]=f[3*x:3*x+3]
        moved.append(g)
    frames=moved; print('vertices in faces',len(perm))
worst=0; where=None
for t,f in enumerate(frames):
    k=max(i for i,(x,_) in enumerate(keys) if x<=t)
    if keys[k][0]==t: a=keys[k][1]; b=a; w=0.0
    else: a=keys[k][1]; b=keys[k+1][1]; w=(t-keys[k][0])/(keys[k+1][0]-keys[k][0])
    assert len(a)==len(f),(len(a),len(f))
    for v in range(0,len(f),3):
        d=math.sqrt(sum((a[v+c]+(b[v+c]-a[v+c])*w-f[v+c])**2 for c in range(3)))
        if d>worst: worst=d; where=(t,v//3)
print(os.path.basename(src),'frames',len(frames),'kept',len(keys),'vertices',len(frames[0])//3,'worst %.6g'%worst,'tol %.6g'%tol,'HOLDS' if worst<=tol*(1+1e-5) else 'BROKEN',where)
