// The names of Metal that a kernel in f32 uses, for the CUDA mode of clang.
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
typedef V<float,4> float4; typedef V<float,2> float2; typedef V<int,4> int4; typedef V<uint,4> uint4; typedef V<int,4> bool4;
struct uint3 { uint x,y,z; };
#define DEV static inline __attribute__((always_inline))
DEV float4 F4(float a){ return float4{a,a,a,a}; } DEV float4 F4(float a,float b,float c,float d){ return float4{a,b,c,d}; } DEV float4 F4(float4 a){return a;}
DEV float4 F4(float2 a, float2 b){ return float4{a.x,a.y,b.x,b.y}; } DEV float4 F4(float2 a, float b, float c){ return float4{a.x,a.y,b,c}; } DEV float4 F4(float a, float2 b, float c){ return float4{a,b.x,b.y,c}; } DEV float4 F4(float a, float b, float2 c){ return float4{a,b,c.x,c.y}; }
typedef V<float,3> float3; typedef V<uint,2> uint2; DEV float4 F4(float3 a, float b){ return float4{a.x,a.y,a.z,b}; } DEV float4 F4(float a, float3 b){ return float4{a,b.x,b.y,b.z}; } DEV uint2 U2(uint a){ return uint2{a,a}; } DEV uint2 U2(uint a,uint b){ return uint2{a,b}; } DEV bool all(V<int,2> c){ return c.x&&c.y; }
DEV int4 I4(int a){ return int4{a,a,a,a}; } DEV uint4 U4(uint a){ return uint4{a,a,a,a}; } DEV uint4 U4(uint a,uint b,uint c,uint d){ return uint4{a,b,c,d}; }
DEV float2 F2(float a){ return float2{a,a}; } DEV float2 F2(float a,float b){ return float2{a,b}; }
// Of a number and NaN, the number.
DEV float min(float a,float b){ return __builtin_fminf(a,b); } DEV float max(float a,float b){ return __builtin_fmaxf(a,b); } DEV uint min(uint a,uint b){ return a<b?a:b; } DEV uint max(uint a,uint b){ return a>b?a:b; }
DEV float abs(float a){ return __builtin_fabsf(a); } DEV float sqrt(float a){ return __nvvm_sqrt_rn_f(a); } DEV float floor(float a){ return __builtin_floorf(a); } DEV float rint(float a){ return __builtin_rintf(a); }
#define MAP2(f) DEV float4 f(float4 a,float4 b){ return float4{f(a.x,b.x),f(a.y,b.y),f(a.z,b.z),f(a.w,b.w)}; } DEV float2 f(float2 a,float2 b){ return float2{f(a.x,b.x),f(a.y,b.y)}; }
#define MAP1(f) DEV float4 f(float4 a){ return float4{f(a.x),f(a.y),f(a.z),f(a.w)}; } DEV float2 f(float2 a){ return float2{f(a.x),f(a.y)}; }
MAP2(min) MAP2(max) MAP1(abs) MAP1(sqrt) MAP1(floor) MAP1(rint)
// static_cast between vectors.
template<class T,class F> DEV T convert(F a){ return __builtin_convertvector(a,T); }
DEV float4 clamp(float4 a,float lo,float hi){ return min(max(a,F4(lo)),F4(hi)); }
DEV int4 clamp(int4 a,int4 lo,int4 hi){ a=a<lo?lo:a; return a>hi?hi:a; }
DEV uint clamp(uint a,uint lo,uint hi){ return min(max(a,lo),hi); }
DEV float clamp(float a,float lo,float hi){ return min(max(a,lo),hi); }
DEV float ldexp1(float a,int n){ return a*__builtin_bit_cast(float,(uint)(n+127)<<23); }
DEV uint popcount(uint a){ return __builtin_popcount(a); } DEV uint clz(uint a){ return a?__builtin_clz(a):32; }
DEV float4 ldexp(float4 a,int4 n){ return float4{ldexp1(a.x,n.x),ldexp1(a.y,n.y),ldexp1(a.z,n.z),ldexp1(a.w,n.w)}; }
// Masks are what comparisons give: -1 and 0.
template<class T,int N> DEV V<T,N> select(V<T,N> a,V<T,N> b,V<int,N> c){ return c?b:a; }
DEV uint4 select(uint4 a,uint b,bool4 c){ return select(a,U4(b),c); }
DEV uint select(uint a,uint b,bool c){ return c?b:a; } DEV float select(float a,float b,bool c){ return c?b:a; }
DEV bool all(bool4 c){ return c.x&&c.y&&c.z&&c.w; } DEV bool any(bool4 c){ return c.x||c.y||c.z||c.w; }
enum class mem_flags { mem_threadgroup, mem_device, mem_none };
DEV void threadgroup_barrier(mem_flags){ __syncthreads_(); }
DEV float shfl(float v,uint l){ return __builtin_bit_cast(float,__nvvm_shfl_sync_idx_i32(0xffffffffu,__builtin_bit_cast(int,v),l,31)); }
DEV float shx(float v,uint l){ return __builtin_bit_cast(float,__nvvm_shfl_sync_bfly_i32(0xffffffffu,__builtin_bit_cast(int,v),l,31)); }
DEV float4 simd_shuffle(float4 v,uint l){ return float4{shfl(v.x,l),shfl(v.y,l),shfl(v.z,l),shfl(v.w,l)}; }
DEV float2 simd_shuffle(float2 v,uint l){ return float2{shfl(v.x,l),shfl(v.y,l)}; }
DEV float simd_shuffle(float v,uint l){ return shfl(v,l); }
DEV float simd_max(float v){ for(uint m=16;m;m>>=1) v=max(v,shx(v,m)); return v; }
DEV float4 simd_max(float4 v){ return float4{simd_max(v.x),simd_max(v.y),simd_max(v.z),simd_max(v.w)}; }
DEV uint simd_broadcast_first(uint v){ return __nvvm_shfl_sync_idx_i32(0xffffffffu,v,0,31); }
}
template<class T,class F> DEV T as_type(F a){ return __builtin_bit_cast(T,a); }
