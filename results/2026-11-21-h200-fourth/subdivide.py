# Each triangle of an OBJ sequence into four, again and again; binary PLY. usage: subdiv.py IN OUT TIMES FRAMES
import sys, re, os, numpy as np
src, out, times, frames = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
natural = lambda n: [int(x) if x.isdigit() else x for x in re.split(r'(\d+)', n)]
names = sorted(os.listdir(src), key=natural)[:frames]
verts, faces = [], None
for n in names:
    v, f = [], []
    for line in open(os.path.join(src, n)):
        p = line.split()
        if not p: continue
        if p[0] == 'v': v.append([float(x) for x in p[1:4]])
        elif p[0] == 'f':
            i = [int(x.split('/')[0]) - 1 for x in p[1:]]
            f += [[i[0], i[k], i[k + 1]] for k in range(1, len(i) - 1)]
    verts.append(np.array(v, np.float64)); faces = np.array(f) if faces is None else faces
for _ in range(times):
    e = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    u, inv = np.unique(e, axis=0, return_inverse=True); inv = inv.reshape(-1)
    m, n = len(faces), len(verts[0]); a, b, c = (n + inv[:m], n + inv[m:2*m], n + inv[2*m:]); x, y, z = faces.T
    faces = np.concatenate([np.stack(t, 1) for t in ([x, a, c], [a, y, b], [c, b, z], [a, b, c])])
    verts = [np.concatenate([v, (v[u[:, 0]] + v[u[:, 1]]) / 2]) for v in verts]
os.makedirs(out, exist_ok=True)
rec = np.empty(len(faces), np.dtype([('n', 'u1'), ('v', '<i4', 3)])); rec['n'] = 3; rec['v'] = faces
for k, v in enumerate(verts):
    with open(os.path.join(out, '%03d.ply' % k), 'wb') as f:
        f.write(('ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n' % (len(v), len(faces))).encode())
        f.write(v.astype('<f4').tobytes()); f.write(rec.tobytes())
print(out, len(faces), 'triangles', len(verts), 'frames')
