/*
 * Kernels as Python callables, by the vectorcall protocol: compiled once for a Python and a numpy, whatever the kernels.
 *
 * An argument that is exactly what a port takes (a C-contiguous, aligned array of its type and shape; a Python number
 * for a scalar) goes straight to the C function. Everything else, and every error, is the business of the Python
 * callable `slow`, which gets the arguments unchanged: so both ways mean the same.
 */
#if defined(__linux__)
#define _GNU_SOURCE /* madvise */
#endif
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stddef.h>
#include <stdint.h>

#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>

#include "output_pool.h"

#define MOST_PORTS 32
#define PIECES_FROM (1 << 20) /* samples from which Python takes pieces, and looks in between whether to stop */
#define RELEASE_FROM 32 /* samples from which giving up the interpreter lock pays */
#define SPARE 2 /* results a port keeps: the one that the caller still holds, and the next one */
#ifdef Py_GIL_DISABLED
#define SPARE_MOST 0 /* a count of references says nothing there */
#else
#define SPARE_MOST 512 /* doubles in a result that is kept */
#endif

typedef struct {
    int ndim;
    int is_complex;
    npy_intp dims[2];
    npy_intp size; /* doubles */
    PyArray_Descr *descr;
    PyObject *name;
    PyObject *spare[SPARE]; /* results of earlier calls; one that nobody else holds is written to again */
    int turn;               /* the spare that the next new result replaces */
} Port;

typedef void (*call_function)(const double *const *, double *const *);
typedef void (*batch_function)(ptrdiff_t, const double *const *, const ptrdiff_t *, double *const *);

typedef struct {
    PyObject_HEAD
    vectorcallfunc vectorcall;
    call_function call;   /* one of the two is set */
    batch_function batch;
    PyObject *slow;       /* takes whatever the fast path does not */
    PyObject *owner;      /* answers for every other attribute */
    PyObject *samples;    /* the batched form, or NULL */
    PyTypeObject *result; /* type of several outputs, a tuple without fields of its own; or NULL */
    PyObject *spare[SPARE]; /* tuples of earlier calls */
    int turn, keeps;        /* whether there are any: not of batches, nor of large results */
    int n_in, n_out;
    Port ports[MOST_PORTS];
} Function;

static PyTypeObject FunctionType;
static PyObject *out_word;

/* Whether an array has the port's shape after `lead` leading axes, its type and a plain layout. */
static inline int fits(const Port *port, PyArrayObject *array, int lead, int flags)
{
    const npy_intp *dims = PyArray_DIMS(array) + lead;
    return PyArray_TYPE(array) == (port->is_complex ? NPY_CDOUBLE : NPY_DOUBLE) && PyArray_NDIM(array) == port->ndim + lead
        && (port->ndim < 1 || dims[0] == port->dims[0]) && (port->ndim < 2 || dims[1] == port->dims[1])
        && PyArray_CHKFLAGS(array, flags) && PyArray_ISNOTSWAPPED(array);
}

/* A Python number for a scalar port: 1 if it was one. */
static inline int number(const Port *port, PyObject *value, double *to)
{
    if (port->ndim != 0) {
        return 0;
    }
    if (PyFloat_Check(value)) {
        to[0] = PyFloat_AS_DOUBLE(value);
        to[1] = 0.0;
        return 1;
    }
    if (PyLong_CheckExact(value)) {
        int overflow;
        const long small = PyLong_AsLongAndOverflow(value, &overflow);
        to[0] = (double)small;
        to[1] = 0.0;
        return overflow == 0;
    }
    if (port->is_complex && PyComplex_CheckExact(value)) {
        const Py_complex both = PyComplex_AsCComplex(value);
        to[0] = both.real;
        to[1] = both.imag;
        return 1;
    }
    return 0;
}

/* Positional and keyword arguments in the order of the inputs; 0 where Python must judge. */
static int bind(const Function *self, PyObject *const *args, Py_ssize_t nargs, PyObject *kwnames, PyObject **values,
    PyObject **out)
{
    const Py_ssize_t named = kwnames == NULL ? 0 : PyTuple_GET_SIZE(kwnames);
    Py_ssize_t k, missing = self->n_in - nargs;
    int i;
    if (missing < 0) {
        return 0;
    }
    for (i = 0; i < self->n_in; ++i) {
        values[i] = i < nargs ? args[i] : NULL;
    }
    for (k = 0; k < named; ++k) {
        PyObject *name = PyTuple_GET_ITEM(kwnames, k), *value = args[nargs + k];
        if (name == out_word) {
            *out = value == Py_None ? NULL : value;
            continue;
        }
        for (i = 0; i < self->n_in && self->ports[i].name != name; ++i) {
        }
        if (i == self->n_in || values[i] != NULL) {
            return 0;
        }
        values[i] = value;
        --missing;
    }
    return missing == 0;
}

static void keep(PyObject **spare, int *turn, PyObject *object)
{
    Py_XSETREF(spare[*turn], Py_NewRef(object));
    *turn = (*turn + 1) % SPARE;
}

static inline PyObject *new_array(const Port *port, int ndim, npy_intp *dims)
{
    Py_INCREF(port->descr);
    return pool_array(port->descr, ndim, dims, port->is_complex ? 2 * sizeof(double) : sizeof(double));
}

/*
 * The array of one result: making one and letting it go costs more than most kernels. With one reference, ours, there is no
 * view, no buffer and no name that could see it written; a weak reference could, and the rest is what its holder
 * may have changed in place.
 */
static PyObject *result_array(Port *port, int keeps)
{
    PyObject *array;
    int k;
    for (k = 0; k < SPARE; ++k) {
        PyArrayObject *old = (PyArrayObject *)port->spare[k];
        if (old != NULL && Py_REFCNT(old) == 1 && PyArray_DESCR(old) == port->descr
            && fits(port, old, 0, NPY_ARRAY_CARRAY | NPY_ARRAY_OWNDATA)
            && ((PyArrayObject_fields *)old)->weakreflist == NULL) {
            return Py_NewRef(old);
        }
    }
    array = new_array(port, port->ndim, port->dims);
    if (array != NULL && keeps) {
        keep(port->spare, &port->turn, array);
    }
    return array;
}

static PyObject *new_tuple(const Function *self)
{
    PyObject *tuple = self->result->tp_alloc(self->result, self->n_out);
#if PY_VERSION_HEX >= 0x030E0000
    if (tuple != NULL) {
        ((PyTupleObject *)tuple)->ob_hash = -1; /* not known yet */
    }
#endif
    return tuple;
}

/* The empty tuple of a call's results: asked for before their arrays, since one that nobody holds any more lets go of its own. */
static PyObject *result_tuple(Function *self)
{
    PyObject *tuple;
    int k, i;
    for (k = 0; k < SPARE; ++k) {
        tuple = self->spare[k];
        if (tuple != NULL && Py_REFCNT(tuple) == 1) {
            Py_INCREF(tuple);
            for (i = 0; i < self->n_out; ++i) {
                PyObject *item = PyTuple_GET_ITEM(tuple, i);
                PyTuple_SET_ITEM(tuple, i, NULL);
                Py_XDECREF(item);
            }
#if PY_VERSION_HEX >= 0x030E0000
            ((PyTupleObject *)tuple)->ob_hash = -1;
#endif
            return tuple;
        }
    }
    tuple = new_tuple(self);
    if (tuple != NULL && self->keeps) {
        keep(self->spare, &self->turn, tuple);
    }
    return tuple;
}

/* The references to the outputs go into the tuple. */
static PyObject *filled(PyObject *tuple, int n_out, PyObject **outputs)
{
    int i;
    for (i = 0; i < n_out; ++i) {
        if (tuple == NULL) {
            Py_DECREF(outputs[i]);
        } else {
            PyTuple_SET_ITEM(tuple, i, outputs[i]);
        }
    }
    return tuple;
}

/* Whether two ranges of memory share a byte. */
static int overlap(const void *a, npy_intp a_size, const void *b, npy_intp b_size)
{
    const uintptr_t x = (uintptr_t)a, y = (uintptr_t)b;
    return x < y + (uintptr_t)b_size && y < x + (uintptr_t)a_size;
}

/* The arrays of out=, one or a tuple of them, if they are what the ports take, and apart. */
static int given(const Function *self, PyObject *out, int lead, npy_intp count, PyObject **outputs, double **to)
{
    int i, k;
    if (self->n_out > 1 && (!PyTuple_Check(out) || PyTuple_GET_SIZE(out) != self->n_out)) {
        return 0;
    }
    for (i = 0; i < self->n_out; ++i) {
        PyObject *one = self->n_out > 1 ? PyTuple_GET_ITEM(out, i) : out;
        PyArrayObject *array = (PyArrayObject *)one;
        if (!PyArray_CheckExact(one) || !fits(&self->ports[self->n_in + i], array, lead, NPY_ARRAY_CARRAY)
            || (lead && PyArray_DIM(array, 0) != count)) {
            return 0;
        }
        outputs[i] = one;
        to[i] = PyArray_DATA(array);
        for (k = 0; k < i; ++k) {
            if (overlap(to[k], PyArray_NBYTES((PyArrayObject *)outputs[k]), to[i], PyArray_NBYTES(array))) {
                return 0;
            }
        }
    }
    return 1;
}

/* Arrays of the caller as the result: a tuple of ours as it is, what an earlier call gave. */
static PyObject *kept(Function *self, PyObject *out, PyObject **outputs)
{
    int i;
    if (self->result != NULL && Py_TYPE(out) == self->result) {
        return Py_NewRef(out);
    }
    for (i = 0; i < self->n_out; ++i) {
        Py_INCREF(outputs[i]);
    }
    return self->result == NULL ? outputs[0] : filled(new_tuple(self), self->n_out, outputs);
}

static PyObject *call_one(PyObject *callable, PyObject *const *args, size_t nargsf, PyObject *kwnames)
{
    Function *self = (Function *)callable;
    const Py_ssize_t nargs = PyVectorcall_NARGS(nargsf);
    PyObject *bound[MOST_PORTS], *outputs[MOST_PORTS], *out = NULL, *tuple = NULL, *const *values = args;
    const double *in[MOST_PORTS];
    double *to[MOST_PORTS], numbers[MOST_PORTS][2];
    int i;
    if (kwnames != NULL || nargs != self->n_in) {
        if (!bind(self, args, nargs, kwnames, bound, &out)) {
            goto slowly;
        }
        values = bound;
    }
    for (i = 0; i < self->n_in; ++i) {
        const Port *port = &self->ports[i];
        if (PyArray_CheckExact(values[i])) {
            PyArrayObject *array = (PyArrayObject *)values[i];
            if (!fits(port, array, 0, NPY_ARRAY_CARRAY_RO)) {
                goto slowly;
            }
            in[i] = PyArray_DATA(array);
        } else if (number(port, values[i], numbers[i])) {
            in[i] = numbers[i];
        } else {
            goto slowly;
        }
    }
    if (out != NULL) {
        if (!given(self, out, 0, 0, outputs, to)) {
            goto slowly;
        }
        self->call(in, to);
        return kept(self, out, outputs);
    }
    if (self->result != NULL && (tuple = result_tuple(self)) == NULL) {
        return NULL;
    }
    for (i = 0; i < self->n_out; ++i) {
        Port *port = &self->ports[self->n_in + i];
        if (port->ndim == 0) {
            outputs[i] = NULL;
            to[i] = numbers[i]; /* the kernel reads every input before it writes an output */
            continue;
        }
        outputs[i] = result_array(port, self->keeps);
        if (outputs[i] == NULL) {
            goto failed;
        }
        to[i] = PyArray_DATA((PyArrayObject *)outputs[i]);
    }
    self->call(in, to);
    for (i = 0; i < self->n_out; ++i) {
        if (outputs[i] == NULL) {
            outputs[i] = self->ports[self->n_in + i].is_complex ? PyComplex_FromDoubles(to[i][0], to[i][1])
                                                                : PyFloat_FromDouble(to[i][0]);
            if (outputs[i] == NULL) {
                int k;
                for (k = i + 1; k < self->n_out; ++k) {
                    Py_XDECREF(outputs[k]);
                }
                goto failed;
            }
        }
    }
    return tuple == NULL ? outputs[0] : filled(tuple, self->n_out, outputs);
failed:
    while (i-- > 0) {
        Py_XDECREF(outputs[i]);
    }
    Py_XDECREF(tuple);
    return NULL;
slowly:
    return PyObject_Vectorcall(self->slow, args, (size_t)nargs, kwnames);
}

static PyObject *call_batch(PyObject *callable, PyObject *const *args, size_t nargsf, PyObject *kwnames)
{
    Function *self = (Function *)callable;
    const Py_ssize_t nargs = PyVectorcall_NARGS(nargsf);
    PyObject *values[MOST_PORTS], *outputs[MOST_PORTS], *out = NULL;
    const double *in[MOST_PORTS];
    double *to[MOST_PORTS], numbers[MOST_PORTS][2];
    ptrdiff_t strides[MOST_PORTS];
    npy_intp count = -1;
    int i;
    if (!bind(self, args, nargs, kwnames, values, &out)) {
        goto slowly;
    }
    for (i = 0; i < self->n_in; ++i) {
        const Port *port = &self->ports[i];
        if (PyArray_CheckExact(values[i])) {
            PyArrayObject *array = (PyArrayObject *)values[i];
            const int lead = PyArray_NDIM(array) > port->ndim;
            if (!fits(port, array, lead, NPY_ARRAY_CARRAY_RO)) {
                goto slowly;
            }
            if (lead) {
                if (count >= 0 && count != PyArray_DIM(array, 0)) {
                    goto slowly;
                }
                count = PyArray_DIM(array, 0);
            }
            in[i] = PyArray_DATA(array);
            strides[i] = lead ? port->size : 0;
        } else if (number(port, values[i], numbers[i])) {
            in[i] = numbers[i];
            strides[i] = 0;
        } else {
            goto slowly;
        }
    }
    if (count < 0 || count > PIECES_FROM) {
        goto slowly;
    }
    if (out != NULL) {
        if (!given(self, out, 1, count, outputs, to)) {
            goto slowly;
        }
        for (i = 0; i < self->n_in; ++i) {
            const npy_intp bytes = (strides[i] == 0 ? 1 : count) * self->ports[i].size * (npy_intp)sizeof(double);
            int k;
            for (k = 0; k < self->n_out; ++k) {
                if (overlap(in[i], bytes, to[k], PyArray_NBYTES((PyArrayObject *)outputs[k]))) {
                    goto slowly;
                }
            }
        }
        for (i = 0; i < self->n_out; ++i) {
            Py_INCREF(outputs[i]);
        }
    } else {
        for (i = 0; i < self->n_out; ++i) {
            const Port *port = &self->ports[self->n_in + i];
            npy_intp dims[3];
            dims[0] = count;
            dims[1] = port->dims[0];
            dims[2] = port->dims[1];
            outputs[i] = new_array(port, port->ndim + 1, dims);
            if (outputs[i] == NULL) {
                while (i-- > 0) {
                    Py_DECREF(outputs[i]);
                }
                return NULL;
            }
            to[i] = PyArray_DATA((PyArrayObject *)outputs[i]);
        }
    }
    if (count < RELEASE_FROM) {
        self->batch(count, in, strides, to);
    } else { /* the caller holds references to the arrays */
        PyThreadState *state = PyEval_SaveThread();
        self->batch(count, in, strides, to);
        PyEval_RestoreThread(state);
    }
    return self->result == NULL ? outputs[0] : filled(new_tuple(self), self->n_out, outputs);
slowly:
    return PyObject_Vectorcall(self->slow, args, (size_t)nargs, kwnames);
}

static int read_ports(Function *self, PyObject *given, int first)
{
    Py_ssize_t k;
    for (k = 0; k < PyTuple_GET_SIZE(given); ++k) {
        Port *port = &self->ports[first + k];
        PyObject *name, *shape;
        int side;
        if (!PyArg_ParseTuple(PyTuple_GET_ITEM(given, k), "UO!p", &name, &PyTuple_Type, &shape, &port->is_complex)) {
            return -1;
        }
        if (PyTuple_GET_SIZE(shape) > 2) {
            PyErr_SetString(PyExc_ValueError, "a port has at most two axes");
            return -1;
        }
        port->ndim = (int)PyTuple_GET_SIZE(shape);
        port->size = port->is_complex ? 2 : 1;
        for (side = 0; side < port->ndim; ++side) {
            port->dims[side] = PyLong_AsSsize_t(PyTuple_GET_ITEM(shape, side));
            if (port->dims[side] < 1) {
                PyErr_SetString(PyExc_ValueError, "the sides of a port are positive");
                return -1;
            }
            port->size *= port->dims[side];
        }
        Py_INCREF(name);
        PyUnicode_InternInPlace(&name);
        port->name = name;
        port->descr = PyArray_DescrFromType(port->is_complex ? NPY_CDOUBLE : NPY_DOUBLE);
    }
    return 0;
}

PyDoc_STRVAR(function_doc,
    "function(call, batch, inputs, outputs, slow, owner, samples, result)\n\n"
    "call, batch: address of the C function, one of them 0. inputs, outputs: (name, shape, is_complex) each.\n"
    "slow: takes what the fast path does not. owner: has the other attributes. samples: attribute `batch`, or None.\n"
    "result: named tuple type of several outputs, or None.");

static PyObject *make_function(PyObject *module, PyObject *args)
{
    unsigned long long call, batch;
    PyObject *inputs, *outputs, *slow, *owner, *samples, *result;
    Function *self;
    int k;
    (void)module;
    if (!PyArg_ParseTuple(args, "KKO!O!OOOO", &call, &batch, &PyTuple_Type, &inputs, &PyTuple_Type, &outputs, &slow,
            &owner, &samples, &result)) {
        return NULL;
    }
    if (PyTuple_GET_SIZE(inputs) + PyTuple_GET_SIZE(outputs) > MOST_PORTS || PyTuple_GET_SIZE(outputs) < 1
        || (call == 0) == (batch == 0) || (result == Py_None) != (PyTuple_GET_SIZE(outputs) == 1)
        || (result != Py_None && !PyType_Check(result))) {
        PyErr_SetString(PyExc_ValueError, "no such function");
        return NULL;
    }
    self = PyObject_GC_New(Function, &FunctionType);
    if (self == NULL) {
        return NULL;
    }
    memset((char *)self + offsetof(Function, vectorcall), 0, sizeof *self - offsetof(Function, vectorcall));
    self->vectorcall = call != 0 ? call_one : call_batch;
    self->call = (call_function)(uintptr_t)call;
    self->batch = (batch_function)(uintptr_t)batch;
    self->slow = Py_NewRef(slow);
    self->owner = Py_NewRef(owner);
    self->samples = samples == Py_None ? NULL : Py_NewRef(samples);
    self->result = result == Py_None ? NULL : (PyTypeObject *)Py_NewRef(result);
    self->n_in = (int)PyTuple_GET_SIZE(inputs);
    self->n_out = (int)PyTuple_GET_SIZE(outputs);
    PyObject_GC_Track(self);
    if (read_ports(self, inputs, 0) < 0 || read_ports(self, outputs, self->n_in) < 0) {
        Py_DECREF(self);
        return NULL;
    }
    self->keeps = call != 0;
    for (k = self->n_in; k < self->n_in + self->n_out; ++k) {
        self->keeps = self->keeps && self->ports[k].size <= SPARE_MOST;
    }
    return (PyObject *)self;
}

static int traverse(PyObject *object, visitproc visit, void *arg)
{
    Function *self = (Function *)object;
    int k;
    Py_VISIT(self->slow);
    Py_VISIT(self->owner);
    Py_VISIT(self->samples);
    Py_VISIT(self->result);
    for (k = 0; k < SPARE; ++k) {
        Py_VISIT(self->spare[k]);
    }
    return 0;
}

static int clear(PyObject *object)
{
    Function *self = (Function *)object;
    int k;
    Py_CLEAR(self->slow);
    Py_CLEAR(self->owner);
    Py_CLEAR(self->samples);
    Py_CLEAR(self->result);
    for (k = 0; k < SPARE; ++k) {
        Py_CLEAR(self->spare[k]);
    }
    return 0;
}

static void destroy(PyObject *object)
{
    Function *self = (Function *)object;
    int i, k;
    PyObject_GC_UnTrack(object);
    clear(object);
    for (i = 0; i < MOST_PORTS; ++i) {
        for (k = 0; k < SPARE; ++k) {
            Py_XDECREF(self->ports[i].spare[k]);
        }
        Py_XDECREF(self->ports[i].descr);
        Py_XDECREF(self->ports[i].name);
    }
    PyObject_GC_Del(object);
}

static PyObject *get_attribute(PyObject *object, PyObject *name)
{
    PyObject *found = PyObject_GenericGetAttr(object, name);
    if (found == NULL && PyErr_ExceptionMatches(PyExc_AttributeError) && ((Function *)object)->owner != NULL) {
        PyErr_Clear();
        found = PyObject_GetAttr(((Function *)object)->owner, name);
    }
    return found;
}

static PyObject *get_samples(PyObject *object, void *closure)
{
    Function *self = (Function *)object;
    (void)closure;
    if (self->samples == NULL) {
        PyErr_SetString(PyExc_AttributeError, "batch");
        return NULL;
    }
    return Py_NewRef(self->samples);
}

static PyObject *get_doc(PyObject *object, void *closure)
{
    (void)closure;
    return PyObject_GetAttrString(((Function *)object)->owner, "__doc__");
}

/* Equal where their owners are: a kernel that was pickled equals the one it was made from. */
static PyObject *compare(PyObject *self, PyObject *other, int operation)
{
    if (Py_TYPE(self) != Py_TYPE(other) || (operation != Py_EQ && operation != Py_NE)) {
        Py_RETURN_NOTIMPLEMENTED;
    }
    return PyObject_RichCompare(((Function *)self)->owner, ((Function *)other)->owner, operation);
}

static Py_hash_t hash_of(PyObject *self)
{
    return PyObject_Hash(((Function *)self)->owner);
}

static PyObject *represent(PyObject *object)
{
    return PyObject_Repr(((Function *)object)->owner);
}

static PyObject *directory(PyObject *object, PyObject *unused)
{
    (void)unused;
    return PyObject_Dir(((Function *)object)->owner);
}

static PyGetSetDef attributes[] = {
    {"batch", get_samples, NULL, NULL, NULL},
    {"__doc__", get_doc, NULL, NULL, NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

static PyMethodDef methods[] = {
    {"__dir__", directory, METH_NOARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static PyTypeObject FunctionType = {
    PyVarObject_HEAD_INIT(NULL, 0)
    .tp_name = "lie_codegen.kernel",
    .tp_basicsize = sizeof(Function),
    .tp_dealloc = destroy,
    .tp_vectorcall_offset = offsetof(Function, vectorcall),
    .tp_repr = represent,
    .tp_call = PyVectorcall_Call,
    .tp_richcompare = compare,
    .tp_hash = hash_of,
    .tp_getattro = get_attribute,
    .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_VECTORCALL | Py_TPFLAGS_HAVE_GC,
    .tp_traverse = traverse,
    .tp_clear = clear,
    .tp_methods = methods,
    .tp_getset = attributes,
};

/* empty(shape, is_complex): as numpy.empty, of the memory of large results. */
static PyObject *make_empty(PyObject *module, PyObject *args)
{
    PyObject *shape;
    npy_intp dims[NPY_MAXDIMS];
    int is_complex, k, ndim;
    (void)module;
    if (!PyArg_ParseTuple(args, "O!p", &PyTuple_Type, &shape, &is_complex)) {
        return NULL;
    }
    ndim = (int)PyTuple_GET_SIZE(shape);
    if (ndim > NPY_MAXDIMS) {
        PyErr_SetString(PyExc_ValueError, "too many axes");
        return NULL;
    }
    for (k = 0; k < ndim; ++k) {
        dims[k] = PyNumber_AsSsize_t(PyTuple_GET_ITEM(shape, k), PyExc_OverflowError);
        if (dims[k] < 0) {
            if (!PyErr_Occurred()) {
                PyErr_SetString(PyExc_ValueError, "negative dimensions are not allowed");
            }
            return NULL;
        }
    }
    return pool_array(PyArray_DescrFromType(is_complex ? NPY_CDOUBLE : NPY_DOUBLE), ndim, dims,
        is_complex ? 2 * sizeof(double) : sizeof(double));
}

/* idle_bytes(): of results that are gone, kept for the next ones. */
static PyObject *idle_bytes(PyObject *module, PyObject *none)
{
    (void)module;
    (void)none;
    return PyLong_FromSize_t(pool_idle_bytes);
}

static PyMethodDef functions[] = {
    {"function", make_function, METH_VARARGS, function_doc},
    {"empty", make_empty, METH_VARARGS, NULL},
    {"idle_bytes", idle_bytes, METH_NOARGS, NULL},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "lie_codegen_call", NULL, -1, functions, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_lie_codegen_call(void)
{
    import_array();
    if (PyType_Ready(&FunctionType) < 0) {
        return NULL;
    }
    out_word = PyUnicode_InternFromString("out");
    return out_word == NULL ? NULL : PyModule_Create(&definition);
}
