// A Vulkan driver that passes every call on to another one and does one thing badly, for tests/cases/hostile.rs.
//
// HOSTILE_DRIVER   the library of the other driver
// HOSTILE_FAULT    what it does badly:
//   nothing        nothing
//   closed         it cannot be opened
//   wrong N        it compiles the N-th addition of a shader, counted from 0, as a subtraction
//   idle           it dispatches nothing
//   compiles       it compiles for ever
//   lost N         it loses the device at submission N
//   hangs N        submission N and all later ones never end
//   memory BYTES   a workgroup has this much memory
//   threads N      a workgroup has this many threads
//   binding BYTES  a storage buffer is at most this large
//
// Its adapter calls itself a discrete GPU named Hostile. The handles are those of the other driver, so there is nothing
// to translate.

#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <vulkan/vulkan.h>
#include <vulkan/vk_icd.h>

// An addition and a subtraction of floats in SPIR-V, which have the same operands.
enum { ADDITION = 129, SUBTRACTION = 131, HEADER_WORDS = 5 };

static const char *fault = "nothing";
static unsigned long long amount;
static void *other;
static VkDevice the_device;
static unsigned long long submissions;
static int lost;

__attribute__((constructor)) static void begin(void) {
    const char *driver = getenv("HOSTILE_DRIVER"), *asked = getenv("HOSTILE_FAULT");
    static char word[32];
    if (asked && sscanf(asked, "%31s %llu", word, &amount) >= 1) fault = word;
    other = driver ? dlopen(driver, RTLD_NOW | RTLD_LOCAL) : NULL;
    if (!other) fprintf(stderr, "HOSTILE_DRIVER: %s\n", dlerror());
}

static int does(const char *what) { return strcmp(fault, what) == 0; }

// What the other driver has under a name. Functions that are replaced here are looked up before they are called.
#define REPLACED(X) \
    X(vkCreateDevice) X(vkGetPhysicalDeviceProperties) X(vkGetPhysicalDeviceProperties2) \
    X(vkGetPhysicalDeviceProperties2KHR) X(vkCreateShaderModule) X(vkCreateComputePipelines) X(vkCmdDispatch) \
    X(vkQueueSubmit) X(vkWaitForFences) X(vkGetFenceStatus) X(vkWaitSemaphores) X(vkWaitSemaphoresKHR) \
    X(vkGetSemaphoreCounterValue) X(vkGetSemaphoreCounterValueKHR) X(vkDeviceWaitIdle) X(vkQueueWaitIdle) \
    X(vkGetDeviceProcAddr)
#define DECLARE(name) static PFN_##name real_##name;
REPLACED(DECLARE)

// The adapter.

static void cut_down(VkPhysicalDeviceProperties *properties) {
    VkPhysicalDeviceLimits *limits = &properties->limits;
    properties->deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
    strcpy(properties->deviceName, "Hostile");
    if (does("memory")) limits->maxComputeSharedMemorySize = amount;
    if (does("threads")) limits->maxComputeWorkGroupInvocations = limits->maxComputeWorkGroupSize[0] = amount;
    if (does("binding")) limits->maxStorageBufferRange = amount;
}

static void own_vkGetPhysicalDeviceProperties(VkPhysicalDevice adapter, VkPhysicalDeviceProperties *properties) {
    real_vkGetPhysicalDeviceProperties(adapter, properties);
    cut_down(properties);
}

static void own_vkGetPhysicalDeviceProperties2(VkPhysicalDevice adapter, VkPhysicalDeviceProperties2 *properties) {
    real_vkGetPhysicalDeviceProperties2(adapter, properties);
    cut_down(&properties->properties);
}

static void own_vkGetPhysicalDeviceProperties2KHR(VkPhysicalDevice adapter, VkPhysicalDeviceProperties2 *properties) {
    real_vkGetPhysicalDeviceProperties2KHR(adapter, properties);
    cut_down(&properties->properties);
}

static VkResult own_vkCreateDevice(VkPhysicalDevice adapter, const VkDeviceCreateInfo *info,
                                   const VkAllocationCallbacks *allocator, VkDevice *device) {
    if (does("closed")) return VK_ERROR_INITIALIZATION_FAILED;
    VkResult result = real_vkCreateDevice(adapter, info, allocator, device);
    the_device = *device;
    return result;
}

// The compiler.

static VkResult own_vkCreateShaderModule(VkDevice device, const VkShaderModuleCreateInfo *info,
                                         const VkAllocationCallbacks *allocator, VkShaderModule *module) {
    if (!does("wrong")) return real_vkCreateShaderModule(device, info, allocator, module);
    uint32_t *code = malloc(info->codeSize);
    memcpy(code, info->pCode, info->codeSize);
    unsigned long long additions = 0;
    // The first word of an instruction has its length above its number.
    for (size_t i = HEADER_WORDS; i < info->codeSize / 4; i += code[i] >> 16)
        if ((code[i] & 0xffff) == ADDITION && additions++ == amount) code[i] += SUBTRACTION - ADDITION;
    VkShaderModuleCreateInfo changed = *info;
    changed.pCode = code;
    VkResult result = real_vkCreateShaderModule(device, &changed, allocator, module);
    free(code);
    return result;
}

static VkResult own_vkCreateComputePipelines(VkDevice device, VkPipelineCache cache, uint32_t count,
                                             const VkComputePipelineCreateInfo *infos,
                                             const VkAllocationCallbacks *allocator, VkPipeline *pipelines) {
    while (does("compiles")) pause();
    return real_vkCreateComputePipelines(device, cache, count, infos, allocator, pipelines);
}

// The device. At its loss it first finishes what it has, since the caller may then release everything.

static VkResult lose(void) {
    if (!lost) real_vkDeviceWaitIdle(the_device);
    lost = 1;
    return VK_ERROR_DEVICE_LOST;
}

static void own_vkCmdDispatch(VkCommandBuffer buffer, uint32_t x, uint32_t y, uint32_t z) {
    if (!does("idle")) real_vkCmdDispatch(buffer, x, y, z);
}

static VkResult own_vkQueueSubmit(VkQueue queue, uint32_t count, const VkSubmitInfo *submits, VkFence fence) {
    int is_due = submissions++ >= amount;
    if (lost || (is_due && does("lost"))) return lose();
    // What was never submitted never ends.
    if (is_due && does("hangs")) {
        if (submissions == amount + 1) fprintf(stderr, "hostile: hangs\n");
        return VK_SUCCESS;
    }
    return real_vkQueueSubmit(queue, count, submits, fence);
}

#define UNLESS_LOST(name, parameters, arguments) \
    static VkResult own_##name parameters { return lost ? VK_ERROR_DEVICE_LOST : real_##name arguments; }
UNLESS_LOST(vkWaitForFences, (VkDevice d, uint32_t n, const VkFence *f, VkBool32 all, uint64_t t), (d, n, f, all, t))
UNLESS_LOST(vkGetFenceStatus, (VkDevice d, VkFence f), (d, f))
UNLESS_LOST(vkWaitSemaphores, (VkDevice d, const VkSemaphoreWaitInfo *i, uint64_t t), (d, i, t))
UNLESS_LOST(vkWaitSemaphoresKHR, (VkDevice d, const VkSemaphoreWaitInfo *i, uint64_t t), (d, i, t))
UNLESS_LOST(vkGetSemaphoreCounterValue, (VkDevice d, VkSemaphore s, uint64_t *v), (d, s, v))
UNLESS_LOST(vkGetSemaphoreCounterValueKHR, (VkDevice d, VkSemaphore s, uint64_t *v), (d, s, v))

// A device that hangs is never idle.
static int hangs(void) { return does("hangs") && submissions > amount; }

static VkResult own_vkDeviceWaitIdle(VkDevice device) {
    while (hangs()) pause();
    return lost ? VK_ERROR_DEVICE_LOST : real_vkDeviceWaitIdle(device);
}

static VkResult own_vkQueueWaitIdle(VkQueue queue) {
    while (hangs()) pause();
    return lost ? VK_ERROR_DEVICE_LOST : real_vkQueueWaitIdle(queue);
}

// Finding functions.

static PFN_vkVoidFunction replaced(const char *name, PFN_vkVoidFunction real);

static PFN_vkVoidFunction own_vkGetDeviceProcAddr(VkDevice device, const char *name) {
    return replaced(name, real_vkGetDeviceProcAddr(device, name));
}

static PFN_vkVoidFunction replaced(const char *name, PFN_vkVoidFunction real) {
    if (!real) return NULL;
#define REPLACE(which) \
    if (strcmp(name, #which) == 0) { \
        real_##which = (PFN_##which)real; \
        return (PFN_vkVoidFunction)own_##which; \
    }
    REPLACED(REPLACE)
    return real;
}

PFN_vkVoidFunction vk_icdGetInstanceProcAddr(VkInstance instance, const char *name) {
    PFN_vk_icdGetInstanceProcAddr find = (PFN_vk_icdGetInstanceProcAddr)dlsym(other, "vk_icdGetInstanceProcAddr");
    return replaced(name, find(instance, name));
}

PFN_vkVoidFunction vk_icdGetPhysicalDeviceProcAddr(VkInstance instance, const char *name) {
    PFN_vk_icdGetPhysicalDeviceProcAddr find =
        (PFN_vk_icdGetPhysicalDeviceProcAddr)dlsym(other, "vk_icdGetPhysicalDeviceProcAddr");
    return find ? replaced(name, find(instance, name)) : NULL;
}

VkResult vk_icdNegotiateLoaderICDInterfaceVersion(uint32_t *version) {
    PFN_vk_icdNegotiateLoaderICDInterfaceVersion agree = (PFN_vk_icdNegotiateLoaderICDInterfaceVersion)dlsym(
        other, "vk_icdNegotiateLoaderICDInterfaceVersion");
    return agree ? agree(version) : VK_ERROR_INCOMPATIBLE_DRIVER;
}
