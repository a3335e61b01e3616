// The names of Metal that a kernel uses, for the CUDA mode of clang; metal_to_cuda.py sets REAL and what depends on it.
#pragma clang force_cuda_host_device begin
typedef unsigned int uint;
#define thread
#define device
#define constant constexpr_or_param
#define threadgroup
#define kernel __attribute__((global)) __attribute__((launch_bounds(LB)))
static inline __attribute__((always_inline)) __attribute__((device)) void __syncthreads_(){ asm volatile("bar.sync 0;":::"memory"); }
namespace metal {
typedef unsigned int uint;
template<class T,int N> using V = T __attribute__((ext_vector_type(N)));
typedef V<REAL,4> float4; typedef V<REAL,2> float2; typedef V<int,4> int4; typedef V<MASK,4> bool4;
struct uint3 { uint x,y,z; };
#define DEV static inline __attribute__((always_inline))
DEV float4 F4(REAL a){ return float4{a,a,a,a}; } DEV float4 F4(REAL a,REAL b,REAL c,REAL d){ return float4{a,b,c,d}; } DEV float4 F4(float4 a){return a;}
DEV float4 F4(float2 a, float2 b){ return float4{a.x,a.y,b.x,b.y}; } DEV float4 F4(float2 a, REAL b, REAL c){ return float4{a.x,a.y,b,c}; } DEV float4 F4(REAL a, float2 b, REAL c){ return float4{a,b.x,b.y,c}; } DEV float4 F4(REAL a, REAL b, float2 c){ return float4{a,b,c.x,c.y}; }
typedef V<REAL,3> float3; typedef V<uint,2> uint2; DEV float4 F4(float3 a, REAL b){ return float4{a.x,a.y,a.z,b}; } DEV float4 F4(REAL a, float3 b){ return float4{a,b.x,b.y,b.z}; } DEV uint2 U2(uint a){ return uint2{a,a}; } DEV uint2 U2(uint a,uint b){ return uint2{a,b}; } DEV bool all(V<int,2> c){ return c.x&&c.y; } 
DEV float2 F2(REAL a){ return float2{a,a}; } DEV float2 F2(REAL a,REAL b){ return float2{a,b}; }
DEV REAL min(REAL a,REAL b){ return a<b?a:b; } DEV REAL max(REAL a,REAL b){ return a>b?a:b; } DEV uint min(uint a,uint b){ return a<b?a:b; } DEV uint max(uint a,uint b){ return a>b?a:b; }
DEV REAL max(REAL a,FOTHER b){ return max(a,(REAL)b); } DEV REAL max(FOTHER a,REAL b){ return max((REAL)a,b); } DEV REAL max(FOTHER a,FOTHER b){ return max((REAL)a,(REAL)b); } DEV REAL min(REAL a,FOTHER b){ return min(a,(REAL)b); } DEV REAL min(FOTHER a,REAL b){ return min((REAL)a,b); } DEV REAL abs(REAL a){ return __builtin_fabs(a); } DEV REAL sqrt(REAL a){ return SQRT(a); } DEV REAL floor(REAL a){ return FLOOR(a); }
#define MAP2(f) DEV float4 f(float4 a,float4 b){ return float4{f(a.x,b.x),f(a.y,b.y),f(a.z,b.z),f(a.w,b.w)}; } DEV float2 f(float2 a,float2 b){ return float2{f(a.x,b.x),f(a.y,b.y)}; }
#define MAP1(f) DEV float4 f(float4 a){ return float4{f(a.x),f(a.y),f(a.z),f(a.w)}; } DEV float2 f(float2 a){ return float2{f(a.x),f(a.y)}; }
MAP2(min) MAP2(max) MAP1(abs) MAP1(sqrt) MAP1(floor)
DEV int4 f2i(float4 a){ return int4{(int)a.x,(int)a.y,(int)a.z,(int)a.w}; }
DEV float4 clamp(float4 a,double lo,double hi){ return min(max(a,F4((REAL)lo)),F4((REAL)hi)); }
DEV uint clamp(uint a,uint lo,uint hi){ return min(max(a,lo),hi); }
DEV REAL clamp(REAL a,REAL lo,REAL hi){ return min(max(a,lo),hi); }
DEV REAL ldexp1(REAL a,int n){ UINT bits=(UINT)(n+BIAS)<<MANT; REAL s; __builtin_memcpy(&s,&bits,sizeof s); return a*s; }
DEV uint popcount(uint a){ return __builtin_popcount(a); }
DEV float4 ldexp(float4 a,int4 n){ return float4{ldexp1(a.x,n.x),ldexp1(a.y,n.y),ldexp1(a.z,n.z),ldexp1(a.w,n.w)}; }
DEV float4 select(float4 a,float4 b,bool4 c){ return float4{c.x?b.x:a.x,c.y?b.y:a.y,c.z?b.z:a.z,c.w?b.w:a.w}; }
DEV uint select(uint a,uint b,bool c){ return c?b:a; } DEV REAL select(REAL a,REAL b,bool c){ return c?b:a; }
DEV uint2 select(uint2 a,uint2 b,V<int,2> c){return uint2{c.x?b.x:a.x,c.y?b.y:a.y};}
DEV bool all(bool4 c){ return c.x&&c.y&&c.z&&c.w; } DEV bool any(bool4 c){ return c.x||c.y||c.z||c.w; }
enum class mem_flags { mem_threadgroup, mem_device, mem_none };
DEV void threadgroup_barrier(mem_flags){ __syncthreads_(); }
DEV REAL shfl(REAL v,uint l){
 if (sizeof(REAL)==4) { int b; __builtin_memcpy(&b,&v,4); b=__nvvm_shfl_sync_idx_i32(0xffffffffu,b,l,31); REAL r; __builtin_memcpy(&r,&b,4); return r; }
 int b[2]; __builtin_memcpy(b,&v,sizeof(REAL)); b[0]=__nvvm_shfl_sync_idx_i32(0xffffffffu,b[0],l,31); b[1]=__nvvm_shfl_sync_idx_i32(0xffffffffu,b[1],l,31); REAL r; __builtin_memcpy(&r,b,sizeof(REAL)); return r; }
DEV REAL shx(REAL v,uint l){
 if (sizeof(REAL)==4) { int b; __builtin_memcpy(&b,&v,4); b=__nvvm_shfl_sync_bfly_i32(0xffffffffu,b,l,31); REAL r; __builtin_memcpy(&r,&b,4); return r; }
 int b[2]; __builtin_memcpy(b,&v,sizeof(REAL)); b[0]=__nvvm_shfl_sync_bfly_i32(0xffffffffu,b[0],l,31); b[1]=__nvvm_shfl_sync_bfly_i32(0xffffffffu,b[1],l,31); REAL r; __builtin_memcpy(&r,b,sizeof(REAL)); return r; }
DEV float4 simd_shuffle(float4 v,uint l){ return float4{shfl(v.x,l),shfl(v.y,l),shfl(v.z,l),shfl(v.w,l)}; }
DEV float2 simd_shuffle(float2 v,uint l){ return float2{shfl(v.x,l),shfl(v.y,l)}; }
DEV REAL simd_shuffle(REAL v,uint l){ return shfl(v,l); }
DEV REAL simd_max(REAL v){ for(uint m=16;m;m>>=1) v=max(v,shx(v,m)); return v; }
DEV float4 simd_max(float4 v){ return float4{simd_max(v.x),simd_max(v.y),simd_max(v.z),simd_max(v.w)}; }
DEV uint simd_broadcast_first(uint v){ return __nvvm_shfl_sync_idx_i32(0xffffffffu,v,0,31); }
}
