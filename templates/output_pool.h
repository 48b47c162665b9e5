/*
 * Memory of large results: blocks that were touched before, since the first touch of a page costs several times the kernel that
 * writes it. A result's block comes back when its array goes, and is handed out again; one that nobody wants for some
 * seconds is given back to the system. Only called with the interpreter lock held.
 */
#ifndef OUTPUT_POOL_H
#define OUTPUT_POOL_H

#include <stdint.h>
#include <string.h>
#include <time.h>

#if defined(__linux__)
#include <sys/mman.h>
#include <unistd.h>
#endif

#define POOL_FROM ((size_t)32768)        /* bytes; smaller results come from numpy's own cache */
#define POOL_HUGE ((size_t)4 << 20)      /* from here on huge pages are asked for */
#define POOL_MOST ((size_t)512 << 20)    /* bytes that lie idle at most, and a quarter of the memory at most */
#define POOL_SECONDS 5
#define POOL_CLASSES 256

typedef struct Block {
    struct Block *next;
    void *raw, *data;
    size_t bytes;
    int kind;
    time_t since;
} Block;

static Block *pool_idle[POOL_CLASSES];
static size_t pool_idle_bytes, pool_limit;
static time_t pool_looked;

/* Classes a quarter of a power of two apart: at most a fifth of a block lies waste. */
static int pool_class(size_t bytes, size_t *rounded)
{
    int power = 0;
    size_t quarter, steps;
    while (((size_t)8 << power) <= bytes) {
        ++power;
    }
    quarter = ((size_t)4 << power) / 4; /* 4 << power <= bytes < 8 << power */
    steps = (bytes - ((size_t)4 << power) + quarter - 1) / quarter;
    *rounded = ((size_t)4 << power) + steps * quarter;
    return 4 * power + (int)steps;
}

static void pool_release(Block *block)
{
    PyMem_RawFree(block->raw);
    PyMem_RawFree(block);
}

static size_t pool_most(void)
{
    if (pool_limit == 0) {
        pool_limit = POOL_MOST;
#if defined(__linux__) && defined(_SC_PHYS_PAGES)
        {
            const long pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGESIZE);
            if (pages > 0 && size > 0 && (size_t)pages / 4 * (size_t)size < pool_limit) {
                pool_limit = (size_t)pages / 4 * (size_t)size;
            }
        }
#endif
    }
    return pool_limit;
}

/* Give back what lay idle for long. */
static void pool_look(time_t now)
{
    int k;
    if (now - pool_looked < POOL_SECONDS && now >= pool_looked) {
        return;
    }
    pool_looked = now;
    for (k = 0; k < POOL_CLASSES; ++k) {
        Block **at = &pool_idle[k];
        while (*at != NULL) {
            Block *block = *at;
            if (now - block->since >= POOL_SECONDS || now < block->since) {
                *at = block->next;
                pool_idle_bytes -= block->bytes;
                pool_release(block);
            } else {
                at = &block->next;
            }
        }
    }
}

static Block *pool_take(size_t bytes)
{
    const size_t line = bytes >= POOL_HUGE ? (size_t)2 << 20 : 64;
    size_t rounded;
    const int kind = pool_class(bytes, &rounded);
    Block *block;
    pool_look(time(NULL));
    block = pool_idle[kind];
    if (block != NULL) {
        pool_idle[kind] = block->next;
        pool_idle_bytes -= block->bytes;
        return block;
    }
    block = PyMem_RawMalloc(sizeof *block);
    if (block == NULL) {
        return NULL;
    }
    block->raw = PyMem_RawMalloc(rounded + line);
    if (block->raw == NULL) {
        PyMem_RawFree(block);
        return NULL;
    }
    block->data = (void *)(((uintptr_t)block->raw + line - 1) / line * line);
    block->bytes = rounded;
    block->kind = kind;
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    if (bytes >= POOL_HUGE) {
        (void)madvise(block->data, rounded, MADV_HUGEPAGE);
    }
#endif
    return block;
}

static void pool_give_back(PyObject *capsule)
{
    Block *block = PyCapsule_GetPointer(capsule, NULL);
    if (block->bytes + pool_idle_bytes > pool_most()) {
        pool_release(block);
        return;
    }
    block->since = time(NULL);
    block->next = pool_idle[block->kind];
    pool_idle[block->kind] = block;
    pool_idle_bytes += block->bytes;
    pool_look(block->since);
}

/* A new array, its memory from the pool where it is large. The descriptor is stolen. */
static PyObject *pool_array(PyArray_Descr *descr, int ndim, npy_intp *dims, size_t item)
{
    size_t bytes = item;
    PyObject *array, *capsule;
    Block *block;
    int k;
    for (k = 0; k < ndim; ++k) {
        if (dims[k] != 0 && bytes > SIZE_MAX / 2 / (size_t)dims[k]) {
            bytes = 0; /* numpy says that it is too large */
            break;
        }
        bytes *= (size_t)dims[k];
    }
#ifdef Py_GIL_DISABLED
    bytes = 0;
#endif
    if (bytes < POOL_FROM || (block = pool_take(bytes)) == NULL) {
        return PyArray_NewFromDescr(&PyArray_Type, descr, ndim, dims, NULL, NULL, 0, NULL);
    }
    capsule = PyCapsule_New(block, NULL, pool_give_back);
    if (capsule == NULL) {
        pool_release(block);
        Py_DECREF(descr);
        return NULL;
    }
    array = PyArray_NewFromDescr(&PyArray_Type, descr, ndim, dims, NULL, block->data, NPY_ARRAY_CARRAY, NULL);
    if (array == NULL || PyArray_SetBaseObject((PyArrayObject *)array, capsule) < 0) { /* which steals the capsule */
        if (array == NULL) {
            Py_DECREF(capsule);
        }
        Py_XDECREF(array);
        return NULL;
    }
    return array;
}

#endif
