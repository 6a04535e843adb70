import pickle,sys,numpy as np,glob
rows={};cost=[];n=0
for p in sys.argv[1:]:
    r,c,k=pickle.load(open(p,'rb')); n+=k; cost+=c
    for a,b in r.items(): rows.setdefault(a,[]).extend(b)
c=np.array(cost); print('flights',n,'motion s/min',(c[:,0]/c[:,2]*60).mean(),'effects s/min',(c[:,1]/c[:,2]*60).mean())
for a,b in rows.items():
    b=np.array(b); e=b[:,1]-b[:,0]; h=(b[:,3]-b[:,2])/2
    z=e/b[:,4]
    print(f'{a:18s} told {len(b):3d}/{n} held {100*np.mean((b[:,2]<=b[:,0])&(b[:,0]<=b[:,3])):4.0f}%  median|err| {np.median(abs(e)):8.4f} rel {100*np.median(abs(e)/abs(b[:,0])):6.1f}%  bias {np.mean(e):8.4f} half {np.median(h):8.4f} rms z {np.sqrt(np.mean(z**2)):5.2f} 95% err {np.percentile(abs(e),95):.4f}')
