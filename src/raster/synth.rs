//! Synthetic terrain as a grid source: `synth:rough,size=4097,seed=7`.
