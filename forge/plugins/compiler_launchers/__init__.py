"""What ccache, sccache and distcc need and tell, for `forge build --compiler-launcher`."""
