# Compiles C++ with GCC while forge builds: compile_cxx.sh COMPILER [ARGUMENT ...]
#
# $FORGE_GCC_HEAP is the size of the heap, in kB, at which GCC starts to collect garbage. The result is
# identical.

case $1 in
  *++ | *++-[0-9]*) ;;
  *) exec "$@" ;;  # a compiler launcher or a linter
esac
case " $* " in
  *" -fplugin"* | *" -specs="* | *" --specs="* | *" -wrapper "* | *" @"*)
    exec "$@" ;;  # these may need anything
esac
# Compilers need no libraries of the workspace, and each of their programs starts faster without its folders.
LD_LIBRARY_PATH=$FORGE_LIBRARY_PATH_BELOW
case " $* " in
  *" -g"* | *" -flto"* | *" -frecord-gcc-switches "*) ;;  # GCC would record the option in the object file
  *ggc-min-* | *" -x c++-header "*) ;;
  *)
    compiler=$1
    shift
    set -- "$compiler" "--param=ggc-min-heapsize=$FORGE_GCC_HEAP" "$@"
    ;;
esac
exec "$@"
