"""Support for ccache, sccache and distcc, for `forge build --compiler-launcher`."""
